"""Tables of `first_order` for the engine: stiffness, a motion for each mode, each motion's pole and transmission.

    CoupledSystem                    -> `couple`           both, stiff
    eigenvectors, pairs              -> `choose_motions`   which of them each mode becomes
    CoupledSystem, Motions           -> `solve_motions`    MotionPoles

Equations: `first_order`; what is computed: src/contact/coupling/motion_poles.hpp.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.contact.coupling.coupled_modes import CoupledSystem
from sonic_bullet.records import Array


class Motions(NamedTuple):
    """Motions of a body, and of its light partners, on its springs without losses.

    Attributes
    ----------
    value : ω² of all (n,)
    vector : (n, n) of all, by columns; rows of pairs are turned in place
    both : (r, n) of `couple`; columns of pairs are turned in place
    chosen : (m,) that of each mode; of a pair in place in the order in which they resemble those before
    pairs : (p,)
    before : (m, m) earlier turn; (0, 0) for the identity
    """

    value: Array
    vector: Array
    both: Array
    chosen: Array
    pairs: Array
    before: Array


class MotionPoles(NamedTuple):
    """Poles of the motions chosen; see `CoupledModes`.

    Attributes
    ----------
    omega_rad_s, decay_per_s : (m,)
    turn, motion : (m, m)
    shares : (m, 3)
    newton : (m,)
    force : (2, r, m) at the springs, for a velocity of 1 of a motion
    moved : (P, m) complex, velocity of all partners' modes
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    motion: Array
    shares: Array
    newton: Array
    force: Array
    moved: Array


def couple(system: CoupledSystem) -> tuple[Array, Array]:
    """Compute both (r, n), motion at the springs of the body and of light partners' rigid motions, and their stiffness.

    The stiffness (n, n) is Λ + bothᵀ Re(K) both.
    """
    n = _engine.count_motions(system)
    both, stiffness = np.empty((len(system.spring), n)), np.empty((n, n))
    _engine.couple_springs(system, both, stiffness)
    return both, stiffness


def choose_motions(vector: Array, modes: int, pairs: Array) -> Array:
    """Choose for each mode the column (m,) of vector with most of it, of a pair the two with most of both.

    Where two choose the same, the first of them is -1: their sum is not the largest.
    """
    chosen = np.empty(modes, np.int64)
    _engine.choose_motions(vector, pairs, chosen)
    return chosen


def solve_motions(system: CoupledSystem, motions: Motions) -> MotionPoles:
    """Compute the poles of the motions chosen; turns rows and columns of ``motions`` in place."""
    m, r = len(motions.chosen), len(system.spring)
    partner_modes = _engine.count_partner_modes(system)
    poles = MotionPoles(
        np.empty(m), np.empty(m), np.empty((m, m)), np.empty((m, m)), np.empty((m, 3)), np.empty(m, bool),
        np.empty((2, r, m)), np.empty((partner_modes, m), complex),
    )  # fmt: skip
    _engine.solve_motions(system, motions, poles)
    return poles
