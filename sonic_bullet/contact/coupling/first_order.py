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
    STIFFEST_RATIO,
    STOPPED_RATIO,
    ContactPoint,
    CoupledModes,
    collect_springs,
    uncoupled_modes,
)
from sonic_bullet.contact.coupling.mobility import BodyMobility
from sonic_bullet.records import Array


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
    m = len(body.omega_rad_s)
    if not m or not any(t.spring.normal_n_m or t.spring.tangential_n_m for t in touches):
        return uncoupled_modes(body, partners, touches)
    x, row = collect_springs(body, partners, touches)
    light = np.flatnonzero((x.other_lam == 0) & x.other.any(axis=0))
    yields = np.flatnonzero(x.other_lam > 0)
    modes = x.other[:, yields]
    both = np.hstack([x.own, -x.other[:, light]])
    spring = x.spring.real
    stiff = both.T @ (spring[:, None] * both)
    stiff[np.diag_indices(len(x.lam))] += x.lam
    value, vector = np.linalg.eigh(stiff)
    chosen, turn = _choose(vector, body.pairs, np.eye(m) if before is None else before)
    vector[:m], both[:, :m] = turn.T @ vector[:m], both[:, :m] @ turn
    q, omega = vector[:, chosen], np.sqrt(np.maximum(value[chosen], 0.0))
    every = spring[:, None] * (both @ vector)
    force = every[:, chosen]
    s = 1j * omega
    along = modes.T @ force
    yielding = 1 / (x.other_lam[yields, None] + 2 * x.other_decay[yields, None] * s + s**2)
    moved = along * yielding
    plate = (x.plate[:, None] - x.half_space[:, None] * s**2) / np.where(s == 0, 1, s)
    lossy, gives = (1 / x.spring - 1 / spring)[:, None] * force, times(modes, moved) + plate * force
    contact, partner = (force * lossy).sum(axis=0), (force * gives).sum(axis=0)
    held_against = _held_against(spring, every, value, chosen, lossy + gives)
    yielded = contact + partner
    part = 1 / (1 + held_against / np.where(np.abs(yielded) > 0, yielded, 1))
    shift = part * yielded
    slope = -(part**2) * (moved**2).sum(axis=0)
    shift *= 2 / (1 + np.sqrt(1 - 4 * slope))
    shift = shift.real + 1j * np.minimum(shift.imag, 0)  # no mode gains
    own = (q[:m] ** 2).T @ x.decay[:m]
    new = -own + 1j * np.sqrt(omega**2 - shift - own**2)
    held = (
        (omega > STIFFEST_RATIO * np.sqrt(x.lam[:m].max()))
        | (-new.real > STOPPED_RATIO * np.abs(new))
        | ~(new.imag > 0)
    )
    root = np.sqrt(x.lam[:m])
    new = np.where(held, root * (-STOPPED_RATIO + 1j * np.sqrt(1 - STOPPED_RATIO**2)), new)
    force = np.where(held, 0, force * part) / np.where(s == 0, 1, s)
    lifts = np.zeros((3 * len(touches), m))
    lifts[row] = np.abs(times_real(force, q[:m].T))
    transmitted = np.where(held, 0, moved * part / (1 + shift * part * yielding))
    transmitted /= 1 + size_squared(transmitted).sum(axis=0)
    transmitted = times_real(transmitted, q[:m].T)
    ends = np.cumsum([0, *(len(p.omega_rad_s) for p in partners)])
    decay = np.maximum(-new.real, 0.0)
    power = np.stack([own, -contact.imag, -partner.imag], axis=1)
    power[:, 1:] *= (np.abs(part) ** 2 / np.maximum(2 * omega, 1e-300))[:, None]
    power = np.maximum(power, 0.0)
    whole = np.maximum(power.sum(axis=1, keepdims=True), 1e-300)
    return CoupledModes(
        new.imag,
        decay,
        turn,
        tuple(transmitted[a:b] for a, b in pairwise(ends)),
        lifts[::3],
        decay[:, None] * power / whole,
        ~held,
    )


def assign_columns(share: Array) -> Array:
    """Assign to each row of weights (m, n) a column, each once, with the largest sum; -1 (m,) where none is left."""
    from scipy.optimize import linear_sum_assignment  # takes a fifth of a second to import

    row, column = linear_sum_assignment(share, maximize=True)
    chosen = np.full(len(share), -1)
    chosen[row] = column
    return chosen


def _choose(vector: Array, pairs: Array, before: Array) -> tuple[Array, Array]:
    """Choose a motion, a column of vector (≥ m, n), for each mode (m,), and turn (m, m) the pairs to theirs.

    Of each pair the turn is the orthogonal matrix nearest to its part of the two motions [Schönemann 1966], columns in
    the order, and with the sign, in which they resemble those before.
    """
    m = len(before)
    share, turn = vector[:m] ** 2, np.eye(m)
    share[pairs] = share[pairs + 1] = 0.5 * (share[pairs] + share[pairs + 1])
    chosen = assign_columns(share)
    both = np.stack([pairs, pairs + 1], axis=1)
    block = both[:, :, None], both[:, None]
    left, _, right = np.linalg.svd(vector[both[:, :, None], chosen[both][:, None]])
    made = left @ right
    along = before[block].transpose(0, 2, 1) @ made
    crossed = np.abs(along[:, 0, 1]) + np.abs(along[:, 1, 0]) > np.abs(along[:, 0, 0]) + np.abs(along[:, 1, 1])
    made[crossed], along[crossed] = made[crossed, :, ::-1], along[crossed, :, ::-1]
    chosen[both[crossed]] = chosen[both[crossed]][:, ::-1]
    turn[block] = made * np.where(np.diagonal(along, axis1=1, axis2=2) < 0, -1.0, 1.0)[:, None]
    return chosen, turn


def _held_against(spring: Array, every: Array, value: Array, chosen: Array, gives: Array) -> Array:
    """Compute gᵀRg (m,) of forces F (r, n) of all motions and compliant motion of the chosen ones, g (r, m).

    Two motions of nearly one frequency would each need the other's: their mutual term is bounded by their product.
    """
    product = times(every.T, gives)  # F_nᵀ g_k
    product[chosen, np.arange(len(chosen))] = 0
    apart = value[:, None] - value[chosen]
    bound = apart**2 + size_squared(product)
    others = (product**2 * (apart / np.where(bound > 0, bound, 1))).sum(axis=0)
    return np.asarray(spring @ gives**2 - others)


def times_real(z: Array, matrix: Array) -> Array:
    """Multiply a complex matrix by a real one."""
    return times(matrix.T, z.T).T


def times(matrix: Array, z: Array) -> Array:
    """Multiply a real matrix by a complex one, in half the time."""
    both: Array = matrix @ np.ascontiguousarray(z).view(float)
    return both.view(complex)


def size_squared(z: Array) -> Array:
    """Compute |z|²."""
    return np.asarray(z.real**2 + z.imag**2)
