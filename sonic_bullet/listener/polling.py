"""From PyBullet's contact tuples to arrays of loaded contacts.

    J = dt · (N n + f1 t1 + f2 t2)      on body A, world frame; -J on body B

with dt the time step set at the moment of the query: that product, and no other, balances m·Δv - m·g·dt (measured to
1e-13). Only the unfiltered getContactPoints() is right: with a body filter that swaps the pair, normal and positions
are turned round and the friction fields are not (bullet3 issues 2765, 3026). k rows.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from sonic_bullet.listener.frames import BEYOND, encode
from sonic_bullet.listener.kinematics import impulses
from sonic_bullet.records import Array

RawContact = tuple[Any, ...]
FORCE, FRICTION_1, FRICTION_2 = 9, 10, 12


@dataclass(frozen=True, slots=True, eq=False)
class Touches:
    """Loaded contacts as PyBullet tells them: code_a, code_b (k,) of frames.encode; points, normal (k, 3) world frame;
    gap_m (k,); impulse_n_s (k, 3) on a; elapsed_s (k,): from the start of the step to the start of the sub-step that
    loaded it."""

    code_a: Array
    code_b: Array
    point_a_m: Array
    point_b_m: Array
    normal: Array
    gap_m: Array
    impulse_n_s: Array
    elapsed_s: Array

    def __len__(self) -> int:
        return len(self.code_a)

    @property
    def usable(self) -> Array:
        """(k,) False where a force or place is NaN or `BEYOND` what can be."""
        numbers = np.concatenate(
            [self.impulse_n_s, self.point_a_m, self.point_b_m, self.normal, self.gap_m[:, None]], axis=1
        )
        return np.asarray((np.abs(numbers) < BEYOND).all(axis=1))

    def kept(self, mask: Array) -> Touches:
        """Only the rows where mask (k,) is True."""
        return Touches(*(getattr(self, name)[mask] for name in self.__slots__))

    def equals(self, other: Touches) -> bool:
        """Whether every number is the same, bit for bit."""
        return len(self) == len(other) and all(
            np.array_equal(getattr(self, name), getattr(other, name)) for name in self.__slots__
        )


def loaded(contacts: Iterable[RawContact], before: Iterable[RawContact] = ()) -> list[RawContact]:
    """Those that carry force: Bullet lists neighbours up to 2 cm apart too. NaN counts as force, to be caught.

    before: what was polled after the step before. A contact farther off than its contactProcessingThreshold is not
    solved and keeps the friction of the step in which it last was, to the bit, beside no normal force: that acts on
    nobody. (Friction without normal force that is new does act: the solver ended between the two, and without it
    momentum does not balance.)
    """
    rows = [raw for raw in contacts if raw[FORCE] != 0 or raw[FRICTION_1] != 0 or raw[FRICTION_2] != 0]
    if all(raw[FORCE] != 0 for raw in rows):
        return rows
    known = {(raw[1:5], raw[FRICTION_1], raw[FRICTION_2]) for raw in before}
    return [raw for raw in rows if raw[FORCE] != 0 or (raw[1:5], raw[FRICTION_1], raw[FRICTION_2]) not in known]


def gather(contacts: list[RawContact], dt_s: float) -> Touches:
    """Arrays of loaded contacts, numbers or not (`Touches.usable`)."""
    k = len(contacts)
    if k == 0:
        none, none3 = np.zeros(0), np.zeros((0, 3))
        return Touches(np.zeros(0, np.int64), np.zeros(0, np.int64), none3, none3, none3, none, none3, none)
    _, body_a, body_b, link_a, link_b, point_a, point_b, normal, gap, force, f1, t1, f2, t2 = zip(
        *contacts, strict=True
    )
    # a third faster than np.fromiter
    packed = struct.pack(f"{15 * k}d", *chain.from_iterable(point_a + point_b + normal + t1 + t2))
    place_a, place_b, n, tangent_1, tangent_2 = np.frombuffer(packed).reshape(5, k, 3)
    scalar = np.frombuffer(struct.pack(f"{4 * k}d", *gap, *force, *f1, *f2)).reshape(4, k)
    ids = np.frombuffer(struct.pack(f"{4 * k}q", *body_a, *body_b, *link_a, *link_b), np.int64).reshape(4, k)
    impulse = impulses(dt_s, n, tangent_1, tangent_2, scalar[1:])
    return Touches(encode(ids[0], ids[2]), encode(ids[1], ids[3]), place_a, place_b, n, scalar[0], impulse, np.zeros(k))
