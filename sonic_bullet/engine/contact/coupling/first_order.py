"""Poles of a body in contact, in milliseconds: springs exactly, losses and the partners' mobility in one step.

    BodyMobility (body, partners) + ContactPoint -> CoupledSystem -> CoupledModes

Equations, and what computes them: src/contact/coupling/coupled_modes.hpp. To first order they are Rayleigh's quotient,
from which Newton's iteration finds the exact poles at many times the cost (docs/measured/in-place.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sonic_bullet import _engine
from sonic_bullet._engine import TURN
from sonic_bullet.engine.contact.coupling.coupled_modes import (
    ContactPoint,
    CoupledModes,
    CoupledSystem,
    collect_springs,
    uncoupled_modes,
)
from sonic_bullet.engine.contact.coupling.mobility import BodyMobility
from sonic_bullet.records import Array


class _MotionPoles(NamedTuple):
    """Poles of the motions chosen, as the engine has them (src/contact/coupling/motion_poles.hpp)."""

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    motion: Array
    shares: Array
    newton: Array
    force: Array
    moved: Array


def first_order(body: BodyMobility, partners: Sequence[BodyMobility], touches: Sequence[ContactPoint]) -> CoupledModes:
    """Compute the coupled modes of a body at these touches; without touches, its free modes.

    `turn` turns the pairs of one frequency, and they alone, to the contact's axes.
    """
    if not touches:
        return uncoupled_modes(body, partners)
    return _solve_system(body, partners, *collect_springs(body, partners, touches), len(touches))


def _solve_system(
    body: BodyMobility, partners: Sequence[BodyMobility], x: CoupledSystem, direction: Array, touches: int
) -> CoupledModes:
    """Compute what `first_order` does, of springs in these of all (3c,) directions of so many touches."""
    m, r, pairs = len(body.omega_rad_s), len(direction), body.pairs
    if not m or not r:
        return uncoupled_modes(body, partners, touches)
    found = _MotionPoles(
        np.empty(m), np.empty(m), np.empty(len(pairs), TURN), np.empty((m, m)), np.empty((m, 3)), np.empty(m, bool),
        np.empty((2, r, m)), np.empty((2, int((x.other_lam > 0).sum()), m)),
    )  # fmt: skip
    force_n_s = np.empty((touches, m))
    if not _engine.couple_modes(x, direction, pairs, np.zeros(0, TURN), found, force_n_s):
        raise np.linalg.LinAlgError("poles of springs or modes that are not finite")
    turn = np.eye(m)
    both = pairs[:, None] + np.arange(2)
    turn[both[:, :, None], both[:, None]] = found.turn["by"]
    moved = found.moved[0] + 1j * found.moved[1]
    ends = np.cumsum([0, *(len(p.omega_rad_s) for p in partners)])
    return CoupledModes(
        found.omega_rad_s, found.decay_per_s, turn, np.ascontiguousarray(found.motion.T),
        tuple(moved[a:b] for a, b in pairwise(ends)), force_n_s, found.shares, found.newton,
    )  # fmt: skip


def assign_columns(weight: Array) -> Array:
    """Assign to each row of weights (m, n) a column, each once, with the largest sum; -1 (m,) where none is left."""
    rows, columns = weight.shape
    if rows > columns:
        chosen = np.full(rows, -1)
        chosen[assign_columns(weight.T)] = np.arange(columns)
        return chosen
    column = np.empty(rows, np.int64)
    _engine.assign_columns(np.ascontiguousarray(weight, float), column)
    return column
