"""Poles of a body in contact, in milliseconds: springs exactly, losses and the partners' mobility in one step.

    (Λ + Bᵀ Re(K) B) q = ω² q,  B = (Φ, −Φ_r)     the body's modes and rigid motions, light partners' rigid motions
    F_n = Re(K) B q_n,  s = jω_k                   forces at the touches, of each motion
    g = Y F_k,  Y = 1/K − 1/Re K + Σ_j φ_j φ_jᵀ/(λ_j + 2 d_j s + s²)     compliance beside the springs, and its motion
    x = F_kᵀg,  ρ = gᵀRg/x,  R = Re K − Σ_{n≠k} F_n F_nᵀ/(ω_n² − ω_k²)     resistance of all other motions to it
    δ = x/(1 + ρ),  ε = dδ/ds²                      exact at one touch, or of one compliant motion
    s² + 2 s qᵀDq + ω² − 2δ/(1 + √(1 − 4ε)) = 0     δ taken on as the one pole c²/(D + s²) that has this value and slope

Of det(1 + Y(s)(Re K − Σ_n F_n F_nᵀ/(ω_n² + s²))) = 0, the springs' ends held and then released. To first order in x it
is Rayleigh's quotient, from which Newton's iteration finds the exact pole at many times the cost. The measured
difference between the two is in docs/measured/in-place.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from sonic_bullet.contact.coupling.coupled_modes import (
    ContactPoint,
    CoupledModes,
    CoupledSystem,
    collect_springs,
    uncoupled_modes,
)
from sonic_bullet.contact.coupling.mobility import BodyMobility
from sonic_bullet.contact.coupling.motion_poles import Motions, choose_motions, couple, solve_motions
from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import matrix_product, symmetric_eigenpairs


def first_order(
    body: BodyMobility, partners: Sequence[BodyMobility], touches: Sequence[ContactPoint], before: Array | None = None
) -> CoupledModes:
    """Compute the coupled modes of a body at these touches; without touches, its free modes.

    `turn` turns the pairs of one frequency, and they alone, to the contact's axes.

    A mode takes the pole of the motion that most resembles its free one. Of a pair, the two motions that most resemble
    both: which two of all orthogonal ones the free modes are does not count. Transmission, at most ½ of each such
    motion, and contact forces are those of the mode's own motion, Q of all.

    Parameters
    ----------
    before : Array, shape (m, m)
        An earlier turn: of the two of a pair, each is the one that it resembles. None: the identity.
    """
    if not touches:
        return uncoupled_modes(body, partners)
    return solve_system(body, partners, *collect_springs(body, partners, touches), len(touches), before)


def solve_system(
    body: BodyMobility, partners: Sequence[BodyMobility], x: CoupledSystem, row: Array, touches: int,
    before: Array | None = None,
) -> CoupledModes:  # fmt: skip
    """Compute what `first_order` does, of springs in these of all (3c,) directions of so many touches."""
    m = len(body.omega_rad_s)
    if not m or not len(row):
        return uncoupled_modes(body, partners, touches)
    both, stiff = couple(x)
    value, vector = symmetric_eigenpairs(stiff)
    chosen = choose_motions(vector, m, body.pairs)
    if chosen[0] < 0:
        chosen = _share_motions(vector[:m], body.pairs)
    earlier = np.zeros((0, 0)) if before is None else before
    found = solve_motions(x, Motions(value, vector, both, chosen, body.pairs, earlier))
    normal = np.flatnonzero(row % 3 == 0)
    lifts = np.zeros((touches, m))
    real, imaginary = (matrix_product(part, found.motion.T) for part in found.force[:, normal])
    lifts[row[normal] // 3] = np.sqrt(real**2 + imaginary**2)
    ends = np.cumsum([0, *(len(p.omega_rad_s) for p in partners)])
    moved = tuple(found.moved[a:b] for a, b in pairwise(ends))
    return CoupledModes(
        found.omega_rad_s, found.decay_per_s, found.turn, found.motion, moved, lifts, found.shares, found.newton
    )


def assign_columns(share: Array) -> Array:
    """Assign to each row of weights (m, n) a column, each once, with the largest sum; -1 (m,) where none is left."""
    from scipy.optimize import linear_sum_assignment  # takes a fifth of a second to import

    row, column = linear_sum_assignment(share, maximize=True)
    chosen = np.full(len(share), -1)
    chosen[row] = column
    return chosen


def _share_motions(motion: Array, pairs: Array) -> Array:
    """Choose a motion, a column of motion (m, n), for each mode (m,) where two have most of the same one.

    The two of a pair count as one.
    """
    share = motion**2
    share[pairs] = share[pairs + 1] = 0.5 * (share[pairs] + share[pairs + 1])
    return assign_columns(share)


def times_real(z: Array, matrix: Array) -> Array:
    """Multiply a complex matrix by a real one."""
    return matrix_product(z, matrix)
