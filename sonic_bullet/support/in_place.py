"""Coupled modes of a body in contact with others, and what it transmits to them.

    Moving (body, partners) + Touch (points, springs) -> Touched -> poles -> InPlace

One body is solved at a time, its partners as they are free of other contacts: a body on a body on a table moves as if
on the table's own modes alone; longer chains are not claimed.

Energy: ½|z|² of the new modes is that of the body and its touches' springs. A change of touches is an orthogonal map
of z, and no decay is below zero: no contact that begins or ends adds energy. A touch begins unstretched, and the energy
of one that ends stays with the body. (A spring attached at an old length would add without bound.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.support.coupled_poles import Touched, inverse_w, poles, squares, start
from sonic_bullet.support.moving import Moving, Place
from sonic_bullet.support.springs import ContactSpring

STOPPED = 0.99
"""d over |s| of a motion that no longer oscillates: a touch stops it."""
LOST = 0.05
"""Of a new mode's motion, in the lane it is given: below this nothing of it is transmitted."""
HELD = 2.0
"""A new mode above so many times the highest own one is the touches' own stiffness: its motion is stopped."""


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One point at which a body touches partner number ``partner``.

    own, other: the point on either; spring: of this point alone.
    """

    partner: int
    own: Place
    other: Place
    spring: ContactSpring


@dataclass(frozen=True, slots=True, eq=False)
class InPlace:
    """A body in contact: m modes as before, mixed.

    Attributes
    ----------
    turn : (m, m) real, orthogonal: new modes in old ones, by columns; column k is what old mode k became
        The identity where they do not mix. State z, gains Uᵀj and shapes of the free modes become turnᵀ z, turnᵀ Uᵀj,
        Φ turn: ½|z|² stays what it is.
    omega_rad_s, decay_per_s : (m,) poles of the new modes; no decay is below 0
    passes : for each partner (m_p, m) complex, its modes' velocity per velocity of each new mode
        At most ½ in all: of two that meet at one frequency, each has the other's half.
    force_n_s : (c, m) amplitude of the normal force at each touch in N, for a velocity amplitude z of 1 of a new mode
        Where Σ|force z| exceeds the load the contact separates.
    shares : (m, 3) parts of decay_per_s that are its own, the contacts' loss, the partners'
    newton : (m,) whether Newton's pole has converged
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    passes: tuple[Array, ...]
    force_n_s: Array
    shares: Array
    newton: Array


def in_place(body: Moving, partners: Sequence[Moving], touches: Sequence[Touch]) -> InPlace:
    """Compute the coupled modes of a body at these touches. Without touches: its free modes."""
    m = len(body.omega_rad_s)
    if not m or not any(t.spring.normal_n_m or t.spring.tangential_n_m for t in touches):
        return InPlace(
            body.omega_rad_s,
            body.decay_per_s,
            np.eye(m),
            tuple(np.zeros((len(p.omega_rad_s), m), complex) for p in partners),
            np.zeros((len(touches), m)),
            np.stack([body.decay_per_s, np.zeros(m), np.zeros(m)], axis=1),
            np.ones(m, bool),
        )
    x, row = touched_rows(body, partners, touches)
    found = _described(x, m, partners, *poles(x, *start(x, m)))
    force = np.zeros((3 * len(touches), m))
    force[row] = found.force_n_s
    return replace(found, force_n_s=force[::3])


def touched_rows(
    body: Moving, partners: Sequence[Moving], touches: Sequence[Touch], *, squared: bool = True
) -> tuple[Touched, Array]:
    """Collect all springs of all touches, and which of their (3c,) directions those are.

    A sliding touch has no tangential one. squared: with φφᵀ, which Newton needs.
    """
    begin = np.cumsum([0, *(len(p.omega_rad_s) + 6 for p in partners)])
    own, of = body.moves([touch.own for touch in touches]), np.array([touch.partner for touch in touches])
    other, under = np.zeros((len(own), int(begin[-1]))), np.zeros((2, len(touches), 3))
    under[:, :, 0] = np.array([(p.plate_m_n_s, p.half_space_m_s_n) for p in partners]).T[:, of]
    for p, partner in enumerate(partners):
        at = np.flatnonzero(of == p)
        if len(at):
            here = (3 * at[:, None] + np.arange(3)).ravel()
            other[here, begin[p] : begin[p + 1]] = partner.moves([touches[i].other for i in at.tolist()])
    spring = np.array([(t.spring.normal_n_m, *2 * (t.spring.tangential_n_m,)) for t in touches], complex).ravel()
    row = np.flatnonzero(spring)
    made = Touched(
        own[row],
        other[row],
        spring[row],
        body.lam,
        body.decay,
        np.concatenate([p.lam for p in partners]),
        np.concatenate([p.decay for p in partners]),
        under[0].ravel()[row],
        under[1].ravel()[row],
        squares(own[row] if squared else own[:0]),
        squares(other[row] if squared else other[:0]),
    )
    return made, row


def _described(x: Touched, m: int, partners: Sequence[Moving], s: Array, q: Array, stands: Array) -> InPlace:
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
    held = (s.imag > HELD * root.max()) | ~(-s.real < STOPPED * np.abs(s)) | (s.imag <= 0)
    s = np.where(held, root * (-STOPPED + 1j * np.sqrt(1 - STOPPED**2)), s)
    v[held] = 0
    decay = np.maximum(-s.real, 0.0)
    force = np.linalg.solve(inverse_w(x, s)[0], (v @ x.own.T)[..., None])[..., 0]
    at = s[:, None]
    passed = at * (force @ x.other) / (at**2 + 2 * x.other_decay * at + x.other_lam)
    passed /= 1 + (np.abs(passed) ** 2).sum(axis=1, keepdims=True)
    ends = np.cumsum([0, *(len(p.omega_rad_s) + 6 for p in partners)])
    return InPlace(
        s.imag,
        decay,
        turn,
        tuple(passed[:, a : b - 6].T for a, b in pairwise(ends)),
        np.abs(force).T,
        _shares(x, m, s.imag, decay, v, force),
        stands & ~held,
    )


def _shares(x: Touched, m: int, omega: Array, decay: Array, v: Array, force: Array) -> Array:
    """Split the decays (m, 3) by the mean powers Σ d|v|², ½ F* Re(jω/K) F and ½ F* Re(Y_p) F."""
    spring = 0.5 * (np.abs(force) ** 2 * (1j * omega[:, None] / x.spring).real).sum(axis=1)
    both = 0.5 * np.einsum("ki,kij,kj->k", force.conj(), inverse_w(x, 1j * omega)[0].real, force).real
    own = (np.abs(v[:, :m]) ** 2 * x.decay[:m]).sum(axis=1)
    power = np.maximum(np.stack([own, spring, both - spring], axis=1), 0.0)
    whole = power.sum(axis=1, keepdims=True)
    return np.asarray(decay[:, None] * np.where(whole > 0, power / np.where(whole > 0, whole, 1), [1.0, 0.0, 0.0]))
