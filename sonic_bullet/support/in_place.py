"""Poles of a body while it touches, and what passes on to those that it touches.

    T(s) q = 0,  T(s) = s² + 2Ds + Λ + s Φᵀ W(s) Φ,  W = (s/K + Y_p(s))⁻¹,  forces at the touches F = W Φ s q
        Φ (3c, m + 6): the body's modes and rigid motions at c touches; Y_p: what the partners yield (`moving`)
    real start   (Λ + Φᵀ Re(K) Φ) q = λ q, heavy partners at rest, light ones with their rigid motions in q
    Newton       s <- s − qᵀT q/qᵀT'q,  q <- T⁻¹ T' q               [Rayleigh quotients: Lancaster 1966, sec. 5.3]

The start is exact in stiffness at any strength and orders all motions, so that equal frequencies part as the touches
want it; Newton adds losses and what partners yield, with everything else kept. T⁻¹ by the touches alone:

    T⁻¹ = D⁻¹ − s D⁻¹Φᵀ S⁻¹ Φ D⁻¹,  D = s² + 2Ds + Λ,  S = s/K + Y_p + s Φ D⁻¹ Φᵀ                 [Woodbury 1950]

Where Newton does not stand still, or finds one pole twice, the poles are those of all bodies at once (`_coupled`).

Energy: ½|z|² of the new modes is that of the body and its touches' springs. A change of touches is an orthogonal map
of z, and no decay is below zero, so that nothing which comes or goes adds energy: a touch begins unstretched, and what
one held when it goes is with the body [what a spring attached at an old length would add is unbounded].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.support.moving import Moving, Place
from sonic_bullet.support.springs import ContactSpring

STEPS = 12
"""Newton steps at most; three are usual, their order is cubic."""
CLOSE = 1e-9
"""Relative change of a pole in the step after which it stands: that step's error is of its third power."""
SPLIT = 1e-9
"""Relative to the higher: poles nearer than this with the same motion are one pole found twice."""
ALIKE = 0.9
"""Product of two unit motions that are the same."""
TINY = 1e-14
"""Least |D| over |s|²: on a free pole itself D has no inverse."""
STOPPED = 0.99
"""d over |s| of what no longer swings: a touch holds that motion."""
LOST = 0.05
"""Of a new mode's motion, in the lane it is given: below this nothing of it passes on."""
HELD = 2.0
"""A new mode above so many times the highest own one is the touches' own stiffness: its motion is stopped."""


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One point at which a body touches partner number ``partner``. own, other: the point on either; spring: of this
    point alone.
    """

    partner: int
    own: Place
    other: Place
    spring: ContactSpring


@dataclass(frozen=True, slots=True, eq=False)
class InPlace:
    """A body while it touches: m modes as before, mixed.

    turn (m, m) real, orthogonal: new modes in old ones, by columns; column k is what old mode k became (the identity
    where they do not mix). State z, gains Uᵀj and shapes of the free modes become turnᵀ z, turnᵀ Uᵀj, Φ turn: ½|z|²
    stays what it is. omega_rad_s, decay_per_s (m,): poles of the new modes; no decay is below 0. passes: for each
    partner (m_p, m) complex, its modes' velocity per velocity of each new mode, at most ½ in all: of two that meet at
    one frequency, each has the other's half. force_n_s (c, m): amplitude of the normal force at each touch in N, for a
    velocity amplitude z of 1 of a new mode: where Σ|force z| exceeds the load the touch lifts. shares (m, 3): parts of
    decay_per_s that are its own, the contacts' loss, the partners'. newton (m,): whether Newton's pole stands.
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    passes: tuple[Array, ...]
    force_n_s: Array
    shares: Array
    newton: Array


class _Touched(NamedTuple):
    """Φ (3c, N) of the body and (3c, P) of all partners side by side; K (3c,); λ, d of both; y₀, y₂ (3c,)."""

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


def in_place(body: Moving, partners: Sequence[Moving], touches: Sequence[Touch]) -> InPlace:
    """What a body becomes at these touches. None of them: what it is when free."""
    m = len(body.omega_rad_s)
    if not touches or not m:
        return InPlace(
            body.omega_rad_s,
            body.decay_per_s,
            np.eye(m),
            tuple(np.zeros((len(p.omega_rad_s), m), complex) for p in partners),
            np.zeros((len(touches), m)),
            np.stack([body.decay_per_s, np.zeros(m), np.zeros(m)], axis=1),
            np.ones(m, bool),
        )
    x = gathered(body, partners, touches)
    pole, q, stands = _poles(x, *_start(x, m))
    return _described(x, m, partners, pole, q, stands)


def gathered(body: Moving, partners: Sequence[Moving], touches: Sequence[Touch], squares: bool = True) -> _Touched:
    """All that touches, in one table; squares: with φφᵀ of each motion, which Newton needs."""
    sizes = [len(p.omega_rad_s) + 6 for p in partners]
    begin = np.cumsum([0, *sizes])
    other = np.zeros((3 * len(touches), int(begin[-1])))
    plate, half_space = np.zeros((2, len(touches), 3))
    for i, touch in enumerate(touches):
        p = touch.partner
        other[3 * i : 3 * i + 3, begin[p] : begin[p + 1]] = partners[p].moves(touch.other)
        plate[i, 0], half_space[i, 0] = partners[p].plate_m_n_s, partners[p].half_space_m_s_n
    springs = [(t.spring.normal_n_m, t.spring.tangential_n_m, t.spring.tangential_n_m) for t in touches]
    own = np.concatenate([body.moves(touch.own) for touch in touches])
    return _Touched(
        own,
        other,
        np.array(springs, complex).ravel(),
        body.lam,
        body.decay,
        np.concatenate([p.lam for p in partners]),
        np.concatenate([p.decay for p in partners]),
        plate.ravel(),
        half_space.ravel(),
        _squares(own if squares else own[:0]),
        _squares(other if squares else other[:0]),
    )


def _start(x: _Touched, m: int) -> tuple[Array, Array]:
    """s (m,) and q (m, N) of the undamped body on springs, old mode by old mode: the new one that has most of it."""
    rigid = np.flatnonzero((x.other_lam == 0) & x.other.any(axis=0))
    both = np.hstack([x.own, -x.other[:, rigid]])
    stiff = both.T @ (x.spring.real[:, None] * both)
    stiff[np.diag_indices(len(x.lam))] += x.lam
    value, vector = np.linalg.eigh(stiff)
    chosen = _most_alike(vector[:m] ** 2)
    return 1j * np.sqrt(np.maximum(value[chosen], 0)), vector[: len(x.lam), chosen].T.astype(complex)


def _most_alike(share: Array) -> Array:
    """The new (m,) of each old by their shares (m, n), the largest first; -1 where none is left."""
    share, chosen = share.copy(), np.full(len(share), -1)
    for _ in range(min(share.shape)):
        old, new = divmod(int(share.argmax()), share.shape[1])
        chosen[old], share[old], share[:, new] = new, -1.0, -1.0
    return chosen


def _summed(weight: Array, square: Array) -> Array:
    """Σ_j w_j φ_j φ_jᵀ (k, 3c, 3c) of weights (k, N) and φ_j φ_jᵀ (N, 9c²)."""
    size = round(np.sqrt(square.shape[1]))
    return np.asarray((weight @ square).reshape(-1, size, size))


def _squares(moves: Array) -> Array:
    """φ_j φ_jᵀ (N, 9c²) of Φ (3c, N)."""
    return np.asarray((moves[:, None] * moves).reshape(-1, moves.shape[1]).T.astype(complex))


def _inverse_w(x: _Touched, s: Array) -> tuple[Array, Array]:
    """W⁻¹(s) and its derivative, (k, 3c, 3c) of s (k,)."""
    at = s[:, None]
    below = at**2 + 2 * x.other_decay * at + x.other_lam
    yields = _summed(at / below, x.other_square)
    slope = _summed((x.other_lam - at**2) / below**2, x.other_square)
    i = np.arange(len(x.spring))
    yields[:, i, i] += at / x.spring + x.plate - x.half_space * at**2
    slope[:, i, i] += 1 / x.spring - 2 * x.half_space * at
    return yields, slope


def _step(x: _Touched, s: Array, q: Array) -> tuple[Array, Array]:
    """Newton's next s and q, of s (k,) and q (k, N)."""
    at = s[:, None]
    inverse, slope = _inverse_w(x, s)
    w = np.linalg.inv(inverse)
    force = np.einsum("kij,kj->ki", w, q @ x.own.T)
    drop = np.einsum("kij,kj->ki", w, np.einsum("kij,kj->ki", slope, force))
    onto = force @ x.own  # ΦᵀWv
    own = at**2 + 2 * x.decay * at + x.lam
    turned = 2 * (at + x.decay) * q + onto - at * (drop @ x.own)  # T' q
    new = s - (q * (own * q + at * onto)).sum(axis=1) / (q * turned).sum(axis=1)
    own = np.where(np.abs(own) < TINY * np.abs(at) ** 2, TINY * np.abs(at) ** 2, own)
    lone = turned / own
    whole = inverse + _summed(at / own, x.own_square)
    back = np.linalg.solve(whole, (lone @ x.own.T)[..., None])[..., 0]
    q = lone - at * (back @ x.own) / own
    return new, q / np.linalg.norm(q, axis=1, keepdims=True)


def _newton(x: _Touched, start: Array, q_start: Array) -> tuple[Array, Array, Array]:
    """s (m,), q (m, N) of each start, and whether Newton's pole stands."""
    s, q, moving = start.copy(), q_start.copy(), np.ones(len(start), bool)
    for _ in range(STEPS):
        at = np.flatnonzero(moving)
        new, q[at] = _step(x, s[at], q[at])
        moving[at] = ~(np.abs(new - s[at]) <= CLOSE * np.abs(new))
        s[at] = new
        if not moving.any():
            break
    return s, q, ~moving & (s.imag > 0)


def _poles(x: _Touched, start: Array, q_start: Array) -> tuple[Array, Array, Array]:
    """Newton's poles; where they do not stand, or one is found twice, those of the coupled eigenproblem."""
    s, q, stands = _newton(x, start, q_start)
    again = ~stands
    same = (np.abs(s[:, None] - s) < SPLIT * np.abs(s)) & (np.abs(q.conj() @ q.T) > ALIKE) & stands & stands[:, None]
    again |= np.any(np.triu(same, 1), axis=0) | np.any(np.triu(same, 1), axis=1)
    if again.any():
        value, vector = _coupled(x)
        free = np.min(np.abs(value[:, None] - s[~again]), axis=1, initial=np.inf) > SPLIT * np.abs(value)
        value, vector = value[free], vector[free]
        new = _most_alike(np.abs(q_start[again].conj() @ vector.T) ** 2)
        found = np.flatnonzero(again)[new >= 0]
        s[found], q[found], stands[found] = value[new[new >= 0]], vector[new[new >= 0]], True
        stands[again & ~np.isin(np.arange(len(s)), found)] = False
    first, _ = _step(x, start, q_start)
    return np.where(stands, s, first), np.where(stands[:, None], q, q_start), stands


def _coupled(x: _Touched) -> tuple[Array, Array]:
    """s (k,) that swing and q (k, N) of all bodies at once, what radiates into half-spaces left out:

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
    q = q[:, : len(x.lam)] / np.linalg.norm(q, axis=1, keepdims=True)  # of those of partners, little
    return value[swings], q


def _described(x: _Touched, m: int, partners: Sequence[Moving], s: Array, q: Array, stands: Array) -> InPlace:
    """The record of poles s (m,) and motions q (m, N)."""
    modes = q[:, :m]
    q = q / np.exp(0.5j * np.angle((modes * modes).sum(axis=1)))[:, None]  # as real as can be
    q *= np.where(np.diag(q.real) < 0, -1, 1)[:, None]
    left, _, right = np.linalg.svd(q[:, :m].real.T)
    turn = left @ right  # the orthogonal matrix nearest to them [Schönemann 1966]
    along = (turn.T * q[:, :m]).sum(axis=1)
    lost = np.where(np.abs(along) > LOST, along, np.inf)
    v = q / lost[:, None]  # velocities where the lane's is 1
    root = np.sqrt(x.lam[:m])
    held = (s.imag > HELD * root.max()) | ~(-s.real < STOPPED * np.abs(s)) | (s.imag <= 0)
    s = np.where(held, root * (-STOPPED + 1j * np.sqrt(1 - STOPPED**2)), s)
    v[held] = 0
    decay = np.maximum(-s.real, 0.0)
    force = np.linalg.solve(_inverse_w(x, s)[0], (v @ x.own.T)[..., None])[..., 0]
    at = s[:, None]
    passed = at * (force @ x.other) / (at**2 + 2 * x.other_decay * at + x.other_lam)
    passed /= 1 + (np.abs(passed) ** 2).sum(axis=1, keepdims=True)
    ends = np.cumsum([0, *(len(p.omega_rad_s) + 6 for p in partners)])
    return InPlace(
        s.imag,
        decay,
        turn,
        tuple(passed[:, a : b - 6].T for a, b in pairwise(ends)),
        np.abs(force[:, ::3]).T,
        _shares(x, m, s.imag, decay, v, force),
        stands & ~held,
    )


def _shares(x: _Touched, m: int, omega: Array, decay: Array, v: Array, force: Array) -> Array:
    """Parts (m, 3) of the decays, by the mean powers Σ d|v|², ½ F* Re(jω/K) F and ½ F* Re(Y_p) F."""
    spring = 0.5 * (np.abs(force) ** 2 * (1j * omega[:, None] / x.spring).real).sum(axis=1)
    both = 0.5 * np.einsum("ki,kij,kj->k", force.conj(), _inverse_w(x, 1j * omega)[0].real, force).real
    own = (np.abs(v[:, :m]) ** 2 * x.decay[:m]).sum(axis=1)
    power = np.maximum(np.stack([own, spring, both - spring], axis=1), 0.0)
    whole = power.sum(axis=1, keepdims=True)
    return np.asarray(decay[:, None] * np.where(whole > 0, power / np.where(whole > 0, whole, 1), [1.0, 0.0, 0.0]))


class KeptPlaces:
    """`in_place`, its last results kept: a body that gets the same touches and loads again, as its loads are quantised
    (`quantised`), is not solved again.
    """

    def __init__(self, most: int = 512) -> None:
        self._most, self._kept = most, dict[bytes, InPlace]()

    def __call__(self, body: Moving, partners: Sequence[Moving], touches: Sequence[Touch]) -> InPlace:
        """See `in_place`."""
        name = blake2b()
        for one in (body, *partners):
            numbers = np.array([len(one.omega_rad_s), one.mass_kg, one.plate_m_n_s, one.half_space_m_s_n])
            for array in (numbers, one.omega_rad_s, one.decay_per_s, one.inertia_kg_m2):
                name.update(np.ascontiguousarray(array, float).tobytes())
        for touch in touches:
            name.update(np.array([touch.partner, touch.spring.normal_n_m, touch.spring.tangential_n_m]).tobytes())
            for place in (touch.own, touch.other):
                for array in (place.shape, place.arm_m, place.axes):
                    name.update(np.ascontiguousarray(array, float).tobytes())
        key = name.digest()
        found = self._kept.pop(key, None)
        if found is None:
            found = in_place(body, partners, touches)
            while len(self._kept) >= self._most:
                del self._kept[next(iter(self._kept))]
        self._kept[key] = found  # the last asked for stands last
        return found
