"""Touches of a body: the points of its contact patches, motion of both bodies there, springs and loads.

    CONTACT_PATCH of its pairs, BodyTable, TouchSides -> fill_touches (src/contact/coupling/touches.hpp) -> Touches

All pairs of a body in one call, since new poles come while it sounds.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sonic_bullet._engine import fill_touches
from sonic_bullet.bank.resonator import Resonator
from sonic_bullet.contact.coupling.coupled_modes import TouchingMotions, partner_columns
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.runtime.synthesis_state import State


class TouchSides(NamedTuple):
    """Elastic properties of the bodies (b,) where they are touched; turns (b, 3, 3): J^{−1/2} by columns."""

    compliance_per_pa: Array
    poisson: Array
    loss_factor: Array
    roughness_m: Array
    slips: Array
    turns: Array


class _Touches(NamedTuple):
    own: Array
    other: Array
    spring: Array
    load_n: Array


class BodyTouches(NamedTuple):
    """Touches (c,) of a body: its partners, those of touches that know no material too; load on each touch."""

    partners: list[int]
    motions: TouchingMotions
    load_n: Array


@lru_cache(maxsize=8)  # the bodies of a scene change seldom; a state's copies share them
def touch_sides(resonators: tuple[Resonator, ...]) -> TouchSides:
    """Collect the bodies' properties where they are touched."""
    sides = [one.side for one in resonators]
    return TouchSides(
        np.array([side.compliance_per_pa for side in sides]),
        np.array([side.poisson for side in sides], float),
        np.array([side.loss_factor for side in sides], float),
        np.array([side.roughness_m for side in sides], float),
        np.array([one.body.dynamics.get("lateralFriction") == 0 for one in resonators], bool),  # μ is their product
        np.array([one.mobility.turn for one in resonators], float),
    )


def collect_touches(state: State, b: int, quaternion: Array) -> BodyTouches:
    """Collect the touches of body b. quaternion (b, 4): all bodies'."""
    sides, pairs = touch_sides(state.resonators), state.pairs
    active = pairs.active[: pairs.count[0]]
    body, count = pairs.pair["body"][active], pairs.patch["count"][active]
    mine = (body == b).any(axis=1) & (count > 0)
    active, body, count = active[mine], body[mine], count[mine]
    other = body.sum(axis=1) - b
    partners = list(dict.fromkeys(other.tolist()))
    known = sides.compliance_per_pa[other] + sides.compliance_per_pa[b] > 0  # else both are rigid
    active, other, count = active[known], other[known], count[known]
    number = np.array([partners.index(one) for one in other.tolist()], np.int64)
    begin = partner_columns([state.resonators[p].mobility for p in partners])
    touches = int(count.sum())
    made = _Touches(
        np.zeros((3 * touches, len(state.resonators[b].mobility.lam))),
        np.zeros((3 * touches, int(begin[-1]))),
        np.empty(3 * touches, complex),
        np.empty(touches),
    )
    if touches:
        fill_touches(b, active, begin[number], state.table, pairs, quaternion, sides, made)
    return BodyTouches(partners, TouchingMotions(*made[:3], np.repeat(number, count)), made.load_n)
