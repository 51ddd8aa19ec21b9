"""Contact rows of one step as both bodies of each pair see them: computed once a step, in arrays, for strikes and
rubbing alike.

Step -> Rows (oriented onto the pair's lower body, in either body's frame) -> touch: face, weights, curvature -> Uᵀf per
    group of rows
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Step
from sonic_bullet.render.resonator import Resonator, Touch, touch_one, uplift
from sonic_bullet.render.rotation import matrix
from sonic_bullet.synth.strikes import pair_key

STEEPEST = 10.0
"""Most friction per normal force that a manifold which carries load may show: a contact that Bullet drops within a step
keeps its friction.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """k rows. key (k,) of the pair; body (k, 2) lower first. impulse_n_s, normal (k, 3): on the lower body, world
    frame. load_n_s (k,): normal part.

    By side, in that body's frame (k, 2, 3): point_m, outward (the surface's normal), push_n_s (impulse on it); arm_m:
    from its centre, world frame. sweep_m_s (k, 2) over the lower's and the higher's surface; approach_m_s, gap_m (k,).
    """

    key: Array
    body: Array
    impulse_n_s: Array
    normal: Array
    load_n_s: Array
    point_m: Array
    outward: Array
    push_n_s: Array
    arm_m: Array
    sweep_m_s: Array
    approach_m_s: Array
    gap_m: Array

    def take(self, rows: Array) -> Rows:
        """The rows ``rows``, in that order."""
        return Rows(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Rows]) -> Rows:
        """The rows of one part or more, in order."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))


def orient(step: Step) -> Rows:
    """The step's contacts, turned onto the lower body of each pair."""
    c = step.contacts
    swap = c.a > c.b
    order = swap.astype(np.int64)
    pick = np.stack([order, 1 - order], axis=1)
    body = np.take_along_axis(np.stack([c.a, c.b], axis=1).astype(np.int64), pick, axis=1)
    sign = np.where(swap, -1.0, 1.0)[:, None]
    impulse, normal = sign * c.impulse_n_s, sign * c.normal
    point = np.take_along_axis(np.stack([c.point_a_m, c.point_b_m], axis=1), pick[:, :, None], axis=1)
    turn = matrix(step.quaternion_xyzw)[body]
    outward = np.stack(
        [np.einsum("kji,kj->ki", turn[:, 0], -normal), np.einsum("kji,kj->ki", turn[:, 1], normal)], axis=1
    )
    push = np.stack(
        [np.einsum("kji,kj->ki", turn[:, 0], impulse), np.einsum("kji,kj->ki", turn[:, 1], -impulse)], axis=1
    )
    load = np.maximum(np.einsum("ki,ki->k", impulse, normal), 0.0)
    arm = np.einsum("ksij,ksj->ksi", turn, point)
    return Rows(
        pair_key(c),
        body,
        impulse,
        normal,
        load,
        point,
        outward,
        push,
        arm,
        np.take_along_axis(c.sweep_m_s, pick, axis=1),
        c.approach_m_s,
        c.gap_m,
    )


def touches(resonators: Sequence[Resonator], rows: Rows) -> tuple[Touch, Touch]:
    """Where the rows lie on the lower and on the higher body's true surface."""
    sides = []
    for side in (0, 1):
        face, barycentric, curvature = (
            np.zeros(len(rows.key), np.int64),
            np.zeros((len(rows.key), 3)),
            np.zeros(len(rows.key)),
        )
        for body in np.unique(rows.body[:, side]):
            mine = np.flatnonzero(rows.body[:, side] == body)
            face[mine], barycentric[mine], curvature[mine] = touch_one(
                resonators[body], rows.point_m[mine, side], rows.outward[mine, side]
            )
        sides.append(Touch(face, barycentric, curvature))
    return sides[0], sides[1]


def modal_pushes(
    resonators: Sequence[Resonator], rows: Rows, where: tuple[Touch, Touch], bounds: Array, scale: Array
) -> list[tuple[Array, Array]]:
    """Uᵀ of groups of rows, summed within each: per group the vectors (m,) on the lower and the higher body's audible
    modes, in N·s/√kg.

    bounds (g+1,): group i has the rows bounds[i] … bounds[i+1]-1, all of one pair, one row at least. scale (k,): of
    each row's impulse.
    """
    push = rows.push_n_s * scale[:, None, None]
    out = []
    for start, stop in itertools.pairwise(bounds):
        low, high = (
            uplift(
                resonators[rows.body[start, side]],
                where[side].face[start:stop],
                where[side].barycentric[start:stop],
                push[start:stop, side],
            )
            for side in (0, 1)
        )
        out.append((low, high))
    return out


def group_sum(group: Array, values: Array, count: int) -> Array:
    """Sum of values (k, …) within each of ``count`` groups (k,): (count, …)."""
    if values.ndim == 1:
        return np.bincount(group, values, count)
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))
    return np.stack([np.bincount(group, column, count) for column in flat.T], axis=1).reshape(count, *values.shape[1:])
