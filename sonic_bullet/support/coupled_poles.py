"""Poles of a body in contact: of T(s) q = 0, a body's modes and rigid motions with forces at its touches.

    T(s) = s² + 2Ds + Λ + s Φᵀ W(s) Φ,  W = (s/K + Y_p(s))⁻¹,  forces F = W Φ s q
        Φ (r, m + 6): the body's modes and rigid motions at r springs; Y_p: the partners' mobility (`moving`)
    real start   (Λ + Bᵀ Re(K) B) q = λ q,  B = (Φ, −Φ_p), of partners their rigid motions
    Newton       s <- s − qᵀT q/qᵀT'q,  q <- T⁻¹ T' q               [Rayleigh quotients: Lancaster 1966, sec. 5.3]
    T⁻¹ = D⁻¹ − s D⁻¹Φᵀ S⁻¹ Φ D⁻¹,  D = s² + 2Ds + Λ,  S = s/K + Y_p + s Φ D⁻¹ Φᵀ                 [Woodbury 1950]

The start is exact in stiffness at any strength and orders all motions, so that equal frequencies split as the touches
require. Newton adds losses and the partners' mobility, with everything else kept, in some three steps of the size of
the touches. Where it does not converge, or finds one pole twice, the poles are those of all bodies at once
(`_coupled`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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


class Touched(NamedTuple):
    """Matrices of a body and its partners at r springs.

    Attributes
    ----------
    own, other : Φ (r, N) of the body and (r, P) of all partners side by side
    spring : K (r,)
    lam, decay, other_lam, other_decay : λ, d of both
    plate, half_space : y₀, y₂ (r,)
    own_square, other_square : φφᵀ of both (`squares`)
    """

    own: Array
    other: Array
    spring: Array
    lam: Array
    decay: Array
    other_lam: Array
    other_decay: Array
    plate: Array
    half_space: Array
    own_square: Array
    other_square: Array


def start(x: Touched, m: int) -> tuple[Array, Array]:
    """Compute s (m,) and q (m, N) of the undamped body on springs: for each old mode the new one with most of it."""
    rigid = np.flatnonzero((x.other_lam == 0) & x.other.any(axis=0))
    both = np.hstack([x.own, -x.other[:, rigid]])
    stiff = both.T @ (x.spring.real[:, None] * both)
    stiff[np.diag_indices(len(x.lam))] += x.lam
    value, vector = np.linalg.eigh(stiff)
    chosen = likest(vector[:m] ** 2)
    return (1j - OFF) * np.sqrt(np.maximum(value[chosen], 0)), vector[: len(x.lam), chosen].T.astype(complex)


def likest(share: Array) -> Array:
    """Assign to each row of weights (m, n) a column, each once, with the largest sum; -1 (m,) where none is left."""
    from scipy.optimize import linear_sum_assignment  # takes a fifth of a second to import

    row, column = linear_sum_assignment(share, maximize=True)
    chosen = np.full(len(share), -1)
    chosen[row] = column
    return chosen


def _summed(weight: Array, square: Array) -> Array:
    """Compute Σ_j w_j φ_j φ_jᵀ (k, r, r) of weights (k, N) and φ_j φ_jᵀ (N, r²)."""
    size = round(np.sqrt(square.shape[1]))
    return np.asarray((weight @ square).reshape(-1, size, size))


def squares(moves: Array) -> Array:
    """Compute φ_j φ_jᵀ (N, r²) of Φ (r, N)."""
    return np.asarray((moves[:, None] * moves).reshape(-1, moves.shape[1]).T.astype(complex))


def _apart(square: Array, s: Array) -> Array:
    """Bound s² + 2ds + λ away from 0, where s is the free pole itself."""
    least = TINY * np.abs(s) ** 2
    return np.asarray(np.where(np.abs(square) < least, least, square))


def inverse_w(x: Touched, s: Array) -> tuple[Array, Array]:
    """Compute W⁻¹(s) and its derivative, (k, r, r) of s (k,)."""
    at = s[:, None]
    below = _apart(at**2 + 2 * x.other_decay * at + x.other_lam, at)
    yields = _summed(at / below, x.other_square)
    slope = _summed((x.other_lam - at**2) / below**2, x.other_square)
    i = np.arange(len(x.spring))
    yields[:, i, i] += at / x.spring + x.plate - x.half_space * at**2
    slope[:, i, i] += 1 / x.spring - 2 * x.half_space * at
    return yields, slope


def _step(x: Touched, s: Array, q: Array) -> tuple[Array, Array]:
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
    whole = inverse + _summed(at / own, x.own_square)
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


def _newton(x: Touched, start: Array, q_start: Array) -> tuple[Array, Array, Array]:
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


def poles(x: Touched, s_start: Array, q_start: Array) -> tuple[Array, Array, Array]:
    """Find the poles by Newton; where they do not converge, or one is found twice, from the coupled eigenproblem."""
    s, q, stands = _newton(x, s_start, q_start)
    again = ~stands
    same = (np.abs(s[:, None] - s) < SPLIT * np.abs(s)) & (np.abs(q.conj() @ q.T) > ALIKE) & stands & stands[:, None]
    again |= np.any(np.triu(same, 1), axis=0) | np.any(np.triu(same, 1), axis=1)
    if again.any():
        value, vector = _coupled(x)
        free = np.min(np.abs(value[:, None] - s[~again]), axis=1, initial=np.inf) > SPLIT * np.abs(value)
        value, vector = value[free], vector[free]
        new = likest(np.abs(q_start[again].conj() @ vector.T) ** 2)
        found = np.flatnonzero(again)[new >= 0]
        s[found], q[found], stands[found] = value[new[new >= 0]], vector[new[new >= 0]], True
        stands[again & ~np.isin(np.arange(len(s)), found)] = False
    first, _ = _step(x, s_start, q_start)
    return np.where(stands, s, first), np.where(stands[:, None], q, q_start), stands


def _coupled(x: Touched) -> tuple[Array, Array]:
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
