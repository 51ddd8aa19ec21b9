"""Exact poles of a body in contact, by Newton: what `first_order` is proven against. T(s) q = 0 of modes and motions.

    T(s) = s² + 2Ds + Λ + s Φᵀ W(s) Φ,  W = (s/K + Y_p(s))⁻¹,  forces F = W Φ s q
        Φ (r, m + 6): the body's modes and rigid motions at r springs; Y_p: the partners' mobility (`mobility`)
    real start   (Λ + Bᵀ Re(K) B) q = λ q,  B = (Φ, −Φ_p), of partners their rigid motions
    Newton       s <- s − qᵀT q/qᵀT'q,  q <- T⁻¹ T' q               [Rayleigh quotients: Lancaster 1966, sec. 5.3]
    T⁻¹ = D⁻¹ − s D⁻¹Φᵀ S⁻¹ Φ D⁻¹,  D = s² + 2Ds + Λ,  S = s/K + Y_p + s Φ D⁻¹ Φᵀ                 [Woodbury 1950]

The start is exact in stiffness at any strength and orders all motions, so that equal frequencies split as the touches
require. Newton adds losses and the partners' mobility, with everything else kept, in some three steps of the size of
the touches. Where it does not converge, or finds one pole twice, the poles are those of all bodies at once
(`_coupled`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from sonic_bullet._engine import STIFFEST_RATIO, STOPPED_RATIO
from sonic_bullet.engine.contact.coupling import BodyMobility, ContactPoint, CoupledModes, first_order
from sonic_bullet.engine.contact.coupling.coupled_modes import CoupledSystem, collect_springs
from sonic_bullet.engine.contact.coupling.first_order import assign_columns
from sonic_bullet.records import Array

STEPS = 12
"""Newton steps at most; three are usual, their order is cubic."""
CLOSE = 1e-9
"""Relative change of a pole in the step after which it has converged: that step's error is of its third power."""
SPLIT = 1e-9
"""Relative to the higher: poles nearer than this with the same motion are one pole found twice."""
ALIKE = 0.9
"""Product of two unit motions that are the same."""
OFF = 1e-6
"""Damping ratio of the start: without any, the partners' mobility might have its own pole just there."""
TINY = 1e-14
"""Least |D| over |s|²: on a free pole itself D has no inverse."""
LOST = 0.05
"""Of a new mode's motion, in the lane it is given: below this nothing of it is transmitted."""


def newton_modes(body: BodyMobility, partners: Sequence[BodyMobility], touches: Sequence[ContactPoint]) -> CoupledModes:
    """Compute the coupled modes of a body at these touches. Without touches: its free modes."""
    m = len(body.omega_rad_s)
    if not m or not any(t.spring.normal_n_m or t.spring.tangential_n_m for t in touches):
        return first_order(body, partners, touches)
    x, row = collect_springs(body, partners, touches)
    found = _described(x, m, partners, *poles(x, *start(x, m)))
    force = np.zeros((3 * len(touches), m))
    force[row] = found.force_n_s
    return replace(found, force_n_s=force[::3])


def _described(
    x: CoupledSystem, m: int, partners: Sequence[BodyMobility], s: Array, q: Array, stands: Array
) -> CoupledModes:
    """Make the record of poles s (m,) and motions q (m, N)."""
    modes = q[:, :m]
    q = q / np.exp(0.5j * np.angle((modes * modes).sum(axis=1)))[:, None]  # rotated to be as real as possible
    q *= np.where(np.diag(q.real) < 0, -1, 1)[:, None]
    left, _, right = np.linalg.svd(q[:, :m].real.T)
    turn = left @ right  # the orthogonal matrix nearest to them [Schönemann 1966]
    along = (turn.T * q[:, :m]).sum(axis=1)
    lost = np.where(np.abs(along) > LOST, along, np.inf)
    v = q / lost[:, None]  # velocities where the lane's is 1
    root = np.sqrt(x.lam[:m])
    held = (s.imag > STIFFEST_RATIO * root.max()) | ~(-s.real < STOPPED_RATIO * np.abs(s)) | (s.imag <= 0)
    s = np.where(held, root * (-STOPPED_RATIO + 1j * np.sqrt(1 - STOPPED_RATIO**2)), s)
    v[held] = 0
    decay = np.maximum(-s.real, 0.0)
    force = np.linalg.solve(inverse_w(x, s)[0], (v @ x.own.T)[..., None])[..., 0]
    at = s[:, None]
    transmitted = at * (force @ x.other) / (at**2 + 2 * x.other_decay * at + x.other_lam)
    transmitted /= 1 + (np.abs(transmitted) ** 2).sum(axis=1, keepdims=True)
    ends = np.cumsum([0, *(len(p.omega_rad_s) + 6 for p in partners)])
    return CoupledModes(
        s.imag,
        decay,
        turn,
        np.eye(m),
        tuple(transmitted[:, a : b - 6].T for a, b in pairwise(ends)),
        np.abs(force).T,
        _shares(x, m, s.imag, decay, v, force),
        stands & ~held,
    )


def _shares(x: CoupledSystem, m: int, omega: Array, decay: Array, v: Array, force: Array) -> Array:
    """Split the decays (m, 3) by the mean powers Σ d|v|², ½ F* Re(jω/K) F and ½ F* Re(Y_p) F."""
    spring = 0.5 * (np.abs(force) ** 2 * (1j * omega[:, None] / x.spring).real).sum(axis=1)
    both = 0.5 * np.einsum("ki,kij,kj->k", force.conj(), inverse_w(x, 1j * omega)[0].real, force).real
    own = (np.abs(v[:, :m]) ** 2 * x.decay[:m]).sum(axis=1)
    power = np.maximum(np.stack([own, spring, both - spring], axis=1), 0.0)
    whole = power.sum(axis=1, keepdims=True)
    return np.asarray(decay[:, None] * np.where(whole > 0, power / np.where(whole > 0, whole, 1), [1.0, 0.0, 0.0]))


def start(x: CoupledSystem, m: int) -> tuple[Array, Array]:
    """Compute s (m,) and q (m, N) of the undamped body on springs: for each old mode the new one with most of it."""
    rigid = np.flatnonzero((x.other_lam == 0) & x.other.any(axis=0))
    both = np.hstack([x.own, -x.other[:, rigid]])
    stiff = both.T @ (x.spring.real[:, None] * both)
    stiff[np.diag_indices(len(x.lam))] += x.lam
    value, vector = np.linalg.eigh(stiff)
    chosen = assign_columns(vector[:m] ** 2)
    return (1j - OFF) * np.sqrt(np.maximum(value[chosen], 0)), vector[: len(x.lam), chosen].T.astype(complex)


def _summed(weight: Array, moves: Array) -> Array:
    """Compute Σ_j w_j φ_j φ_jᵀ (k, r, r) of weights (k, N) and Φ (r, N)."""
    return np.asarray((weight[:, None] * moves) @ moves.T)


def _apart(square: Array, s: Array) -> Array:
    """Bound s² + 2ds + λ away from 0, where s is the free pole itself."""
    least = TINY * np.abs(s) ** 2
    return np.asarray(np.where(np.abs(square) < least, least, square))


def inverse_w(x: CoupledSystem, s: Array) -> tuple[Array, Array]:
    """Compute W⁻¹(s) and its derivative, (k, r, r) of s (k,)."""
    at = s[:, None]
    below = _apart(at**2 + 2 * x.other_decay * at + x.other_lam, at)
    yields = _summed(at / below, x.other)
    slope = _summed((x.other_lam - at**2) / below**2, x.other)
    i = np.arange(len(x.spring))
    yields[:, i, i] += at / x.spring + x.plate - x.half_space * at**2
    slope[:, i, i] += 1 / x.spring - 2 * x.half_space * at
    return yields, slope


def _step(x: CoupledSystem, s: Array, q: Array) -> tuple[Array, Array]:
    """Compute Newton's next s and q, of s (k,) and q (k, N)."""
    at = s[:, None]
    inverse, slope = inverse_w(x, s)
    w = np.linalg.inv(inverse)
    force = np.einsum("kij,kj->ki", w, q @ x.own.T)
    drop = np.einsum("kij,kj->ki", w, np.einsum("kij,kj->ki", slope, force))
    onto = force @ x.own  # ΦᵀWv
    own = at**2 + 2 * x.decay * at + x.lam
    turned = 2 * (at + x.decay) * q + onto - at * (drop @ x.own)  # T' q
    new = s - (q * (own * q + at * onto)).sum(axis=1) / (q * turned).sum(axis=1)
    own = _apart(own, at)
    lone = turned / own
    whole = inverse + _summed(at / own, x.own)
    back = _solved(whole, (lone @ x.own.T)[..., None])[..., 0]
    q = lone - at * (back @ x.own) / own
    return new, q / np.linalg.norm(q, axis=1, keepdims=True)


def _solved(whole: Array, right: Array) -> Array:
    """Solve whole⁻¹ right; exactly on a pole there is no inverse, and next to it the same motion."""
    try:
        return np.asarray(np.linalg.solve(whole, right))
    except np.linalg.LinAlgError:
        off = TINY * np.abs(whole).max(axis=(1, 2), keepdims=True) * np.eye(whole.shape[1])
        return np.asarray(np.linalg.solve(whole + off, right))


def _newton(x: CoupledSystem, start: Array, q_start: Array) -> tuple[Array, Array, Array]:
    """Iterate s (m,), q (m, N) from each start; also return whether Newton's pole has converged."""
    s, q, moving = start.copy(), q_start.copy(), np.ones(len(start), bool)
    for _ in range(STEPS):
        at = np.flatnonzero(moving)
        new, q[at] = _step(x, s[at], q[at])
        moving[at] = ~(np.abs(new - s[at]) <= CLOSE * np.abs(new))
        s[at] = new
        if not moving.any():
            break
    return s, q, ~moving & (s.imag > 0)


def poles(x: CoupledSystem, s_start: Array, q_start: Array) -> tuple[Array, Array, Array]:
    """Find the poles by Newton; where they do not converge, or one is found twice, from the coupled eigenproblem."""
    s, q, stands = _newton(x, s_start, q_start)
    again = ~stands
    same = (np.abs(s[:, None] - s) < SPLIT * np.abs(s)) & (np.abs(q.conj() @ q.T) > ALIKE) & stands & stands[:, None]
    again |= np.any(np.triu(same, 1), axis=0) | np.any(np.triu(same, 1), axis=1)
    if again.any():
        value, vector = _coupled(x)
        free = np.min(np.abs(value[:, None] - s[~again]), axis=1, initial=np.inf) > SPLIT * np.abs(value)
        value, vector = value[free], vector[free]
        new = assign_columns(np.abs(q_start[again].conj() @ vector.T) ** 2)
        found = np.flatnonzero(again)[new >= 0]
        s[found], q[found], stands[found] = value[new[new >= 0]], vector[new[new >= 0]], True
        stands[again & ~np.isin(np.arange(len(s)), found)] = False
    first, _ = _step(x, s_start, q_start)
    return np.where(stands, s, first), np.where(stands[:, None], q, q_start), stands


def _coupled(x: CoupledSystem) -> tuple[Array, Array]:
    """Find s (k,) that oscillate and q (k, N) of all bodies at once, radiation into half-spaces left out.

    q̈ + 2Dq̇ + Λq + Bᵀ K (Bq − p) = 0,  ṗ = y₀ K (Bq − p),  B = (Φ, −Φ_p)         [Tisseur & Meerbergen 2001, sec. 3.4]
    """
    both = np.hstack([x.own, -x.other])
    n, under = both.shape[1], np.flatnonzero(x.plate)
    state = np.zeros((2 * n + len(under),) * 2, complex)
    i = np.arange(n)
    state[i, n + i], state[n + i, n + i] = 1, -2 * np.concatenate([x.decay, x.other_decay])
    state[n + i, i] = -np.concatenate([x.lam, x.other_lam])
    state[n : 2 * n, :n] -= both.T @ (x.spring[:, None] * both)
    state[n : 2 * n, 2 * n :] = both[under].T * x.spring[under]
    state[2 * n :, :n] = (x.plate * x.spring)[under, None] * both[under]
    state[2 * n :, 2 * n :] = -np.diag((x.plate * x.spring)[under])
    scale = np.sqrt(max(x.lam.max(), x.other_lam.max(initial=0.0)))
    state[:n, n : 2 * n] *= scale  # q̇/scale: rows and columns of one size
    state[n : 2 * n, :n] /= scale
    state[n : 2 * n, 2 * n :] /= scale
    value, vector = np.linalg.eig(state)
    swings = value.imag > 1e-6 * scale
    q = vector[:n, swings].T
    q = q[:, : len(x.lam)] / np.linalg.norm(q, axis=1, keepdims=True)  # small for partners' modes
    return value[swings], q
