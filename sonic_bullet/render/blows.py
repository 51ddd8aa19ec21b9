"""Strikes of one physics step, from contact rows to force pulses on modes.

    Split (synth.strikes) + rows of the step and the next ones -> Blow: time, length, impulse, Uᵀf on either body

One `Blow` is one pulse: rows of up to three steps, several points each, share its time history, so that the manifold's
sum and moment, which are all that is reliable, are kept: Uᵀf is summed over the rows, each at its own point with its own
direction, friction included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.contacts import Step
from sonic_bullet.records import Array, Body
from sonic_bullet.render.rotation import matrix, to_body, to_world
from sonic_bullet.render.sounder import Sounder, Touch, force_on_modes, touch
from sonic_bullet.synth.pulse import contact_modulus_pa, contact_time_s, effective_mass_kg
from sonic_bullet.synth.strikes import Split, accepted_impulse, causing_approach_m_s, key_bodies, pair_key, supported_bodies

STEEPEST = 10.0
"""Most friction per normal force that a manifold which carries load may show: a contact that Bullet drops within a step keeps its friction."""
STRUCK_FLAT = 0.02
"""Radius, as a share of the smaller body's size, of the least area that a nearly flat blow touches."""
FLAT_CURVATURE = 0.1
"""Curvature times size below which a contact is flat: a cap of ten times the body's size."""


@dataclass(frozen=True, slots=True, eq=False)
class Blow:
    """One strike. low, high: body indices. start_s: after its step's start, or before it. length_s: of the pulse. flat: half-sine, not Hertz'. impulse_n_s (3,): world, on low.
    modes_low, modes_high (m,): Uᵀj of the whole impulse in N·s/√kg.
    """

    low: int
    high: int
    start_s: float
    length_s: float
    flat: bool
    impulse_n_s: Array
    modes_low: Array
    modes_high: Array


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows (r,) of the steps that a step's strikes use, seen from the lower body of each pair: strike number, body frames, world vectors."""

    strike: Array
    delay: Array
    impulse: Array
    normal: Array
    arm: tuple[Array, Array]
    point: tuple[Array, Array]
    quaternion: tuple[Array, Array]
    approach: Array
    gap: Array


def _gather(split: Split, window: tuple[Step, ...]) -> _Rows:
    """Rows of struck pairs in the step and its followers, impulses scaled to the part that is strike."""
    key = split.key[split.strike]
    parts = []
    for delay, step in enumerate(window[: split.share.shape[1]]):
        rows = step.contacts
        at = np.searchsorted(key, pair_key(rows))
        at = np.minimum(at, len(key) - 1)
        mine = np.flatnonzero(key[at] == pair_key(rows))
        if not len(mine):
            continue
        share = split.share[at[mine], delay]
        mine, share = mine[share > 0], share[share > 0]
        swap = rows.a[mine] > rows.b[mine]
        sign = np.where(swap, -1.0, 1.0)[:, None]
        body = np.where(swap, rows.b[mine], rows.a[mine]), np.where(swap, rows.a[mine], rows.b[mine])
        points = (
            np.where(swap[:, None], rows.point_b_m[mine], rows.point_a_m[mine]),
            np.where(swap[:, None], rows.point_a_m[mine], rows.point_b_m[mine]),
        )
        turns = step.quaternion_xyzw[body[0]], step.quaternion_xyzw[body[1]]
        parts.append(
            (
                at[mine],
                np.full(len(mine), delay),
                sign * share[:, None] * rows.impulse_n_s[mine],
                sign * rows.normal[mine],
                to_world(turns[0], points[0]),
                to_world(turns[1], points[1]),
                *points,
                *turns,
                rows.approach_m_s[mine],
                rows.gap_m[mine],
            )
        )
    strike, delay, impulse, normal, arm_low, arm_high, low, high, turn_low, turn_high, approach, gap = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    return _Rows(strike, delay, impulse, normal, (arm_low, arm_high), (low, high), (turn_low, turn_high), approach, gap)


def _per_strike(rows: _Rows, values: Array, count: int) -> Array:
    """Sum of values (r, …) over the rows of each strike: (q, …)."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, rows.strike, values)
    return total


def find_blows(split: Split, window: tuple[Step, ...], sounders: tuple[Sounder, ...], earliest_s: float) -> tuple[Blow, ...]:
    """The strikes that the rows of window[0] begin; window holds the step and the known ones after it.

    earliest_s: not after 0; a strike is dated back that far at most, where the bodies overlap as the step starts.

    Pairs of which nothing can sound (no modes, no moving volume) are passed over.
    """
    count = len(split.strike)
    if not count:
        return ()
    rows = _gather(split, window)
    step = window[0]
    low, high = key_bodies(split.key[split.strike])
    bodies = [sounder.body for sounder in sounders]
    weight = np.einsum("ri,ri->r", rows.impulse, rows.normal)
    raw = _per_strike(rows, weight, count)
    safe = np.maximum(raw, 1e-300)
    normal = _per_strike(rows, weight[:, None] * rows.normal, count)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    arm = [_per_strike(rows, weight[:, None] * arm, count) / safe[:, None] for arm in rows.arm]
    mass = effective_mass(bodies, low, high, step, arm, normal)
    approach = np.full(count, 0.0)
    np.maximum.at(approach, rows.strike, rows.approach)
    mobile = np.array([body.mass_kg > 0 for body in bodies])
    caused = causing_approach_m_s(approach, low, high, normal, supported_bodies(split, mobile), step.gravity_m_s2 * step.dt_s)
    accepted = accepted_impulse(raw, 2.0 * mass * caused, low, high, mobile)
    start = _start_s(rows, count, earliest_s, step.dt_s)
    carries = raw * STEEPEST >= np.linalg.norm(_per_strike(rows, rows.impulse, count), axis=1)
    blows = []
    for q in np.flatnonzero((accepted > 0) & carries):
        pair = sounders[low[q]], sounders[high[q]]
        if not any(_can_sound(sounder) for sounder in pair):
            continue
        mine = np.flatnonzero(rows.strike == q)
        scale = accepted[q] / raw[q]
        touches = [_touch_side(rows, mine, side, pair[side]) for side in (0, 1)]
        forces = [to_body(rows.quaternion[side][mine], (scale, -scale)[side] * rows.impulse[mine]) for side in (0, 1)]
        strongest = int(np.argmax(weight[mine]))
        speed = approach[q] if approach[q] > 0 else accepted[q] / (1.5 * mass[q])
        share = weight[mine] / weight[mine].sum()
        curvature = float(sum(t.curvature_per_m[strongest] for t in touches))
        length, flat = contact_time_s(
            mass[q],
            contact_modulus_pa(np.array(modulus_pa(pair[0].body)), np.array(modulus_pa(pair[1].body))),
            np.array(curvature),
            np.array(flat_area_m2(rows.point[0][mine], share, pair, curvature, STRUCK_FLAT)),
            np.array(max(speed, 1e-6)),
        )
        blows.append(
            Blow(
                int(low[q]),
                int(high[q]),
                float(start[q]),
                float(length),
                bool(flat),
                scale * rows.impulse[mine].sum(axis=0),
                force_on_modes(pair[0], touches[0], forces[0]),
                force_on_modes(pair[1], touches[1], forces[1]),
            )
        )
    return tuple(blows)


def _can_sound(sounder: Sounder) -> bool:
    return sounder.mode_count > 0 or (sounder.body.material is not None and sounder.body.mass_kg > 0)


def modulus_pa(body: Body) -> float:
    """E/(1-ν²) of the body, infinite where it is a rigid partner."""
    return body.material.plane_strain_pa if body.material is not None else np.inf


def _touch_side(rows: _Rows, mine: Array, side: int, sounder: Sounder) -> Touch:
    outward = (-1.0, 1.0)[side] * to_body(rows.quaternion[side][mine], rows.normal[mine])
    return touch(sounder, rows.point[side][mine], outward)


def effective_mass(
    bodies: Sequence[Body], low: Array, high: Array, step: Step, arm: Sequence[Array], normal: Array, places: tuple[int, int] | None = None
) -> Array:
    """m* (q,) in kg of pairs [synth.pulse], levers ``arm`` (q, 3) in the world; ``places``: where in ``bodies`` the pair stands, if not at low, high."""
    sides: list[Array] = []
    for side, (index, lever) in enumerate(((low, arm[0]), (high, arm[1]))):
        turn = matrix(step.quaternion_xyzw[index])
        which = [bodies[i] for i in index] if places is None else [bodies[places[side]]] * len(index)
        inertia = np.array([body.inertia_kg_m2 for body in which])
        sides += [np.array([body.mass_kg for body in which]), np.einsum("kij,kjl,kml->kim", turn, inertia, turn), lever]
    return np.asarray(effective_mass_kg(*sides, normal))


def _start_s(rows: _Rows, count: int, earliest_s: float, dt_s: float) -> Array:
    """(q,) when the surfaces meet: gap / approach of the first step's rows, negative where they overlap already."""
    first = (rows.delay == 0) & (rows.approach > 0)
    meet = np.full(count, np.inf)
    np.minimum.at(meet, rows.strike[first], rows.gap[first] / rows.approach[first])
    return np.clip(np.where(np.isfinite(meet), meet, 0.0), earliest_s, dt_s)


def flat_area_m2(point_m: Array, share: Array, pair: tuple[Sounder, Sounder], curvature_per_m: float, least_share: float) -> float:
    """Area of a flat contact, 0 where it is curved: the disc with the spread of the manifold's points (r, 3), shares (r,).

    least_share: of the smaller body's size, below which no flat contact's radius is taken to be.
    """
    size = min((s.size_m for s in pair if s.body.volume_m3 > 0), default=0.1)
    if curvature_per_m * size > FLAT_CURVATURE:
        return 0.0
    spread = float(np.sqrt(np.sum(share[:, None] * (point_m - share @ point_m) ** 2)))
    return float(np.pi * max(spread, least_share * size) ** 2)
