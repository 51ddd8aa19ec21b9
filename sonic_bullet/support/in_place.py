"""Poles of a body while it touches, and what passes on to whom it touches.

    T(s) q = 0,   T(s) = s² + 2Ds + Λ + s Φᵀ W(s) Φ,   W(s) = (s/K + Y_p(s))⁻¹     f = W Φ s q: forces at the touches
        Φ (3c, m + 6): the body's modes and rigid motions at c touches; Y_p: what the partners yield (`moving`)

Two steps. The real part of W at a spring's own stiffness gives a symmetric eigenproblem: which motions there are once
the touches hold them, at any strength, an orthogonal mixing of the free ones. From each of them Newton goes to the
pole of T with all others kept, the Rayleigh quotient s − qᵀT q/qᵀT'q, q <- T⁻¹T'q  [Lancaster 1964; Voss 2007].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sonic_bullet.records import Array
from sonic_bullet.support.moving import Moving, Place
from sonic_bullet.support.springs import ContactSpring


@dataclass(frozen=True, slots=True, eq=False)
class Touch:
    """One point at which a body touches partner number ``partner``. own, other: the point on either; spring: of this
    point alone; load_n: N that it carries.
    """

    partner: int
    own: Place
    other: Place
    spring: ContactSpring
    load_n: float


@dataclass(frozen=True, slots=True, eq=False)
class InPlace:
    """A body while it touches: m modes as before, mixed.

    turn (m, m) real, orthogonal: new modes in old ones, by columns; column k is what old mode k became (the identity
    where they do not mix). State z, gains Uᵀj and shapes of the free modes become turnᵀ z, turnᵀ Uᵀj, Φ turn: ½|z|²
    stays what it is. omega_rad_s, decay_per_s (m,): poles of the new modes; decay never below 0.
    passes: for each partner (m_p, m) complex, its modes' velocity per velocity of each new mode; 0 where they meet at
    one frequency and would take turns: at most ½. force_n_s (c, m): amplitude of the normal force at each touch in N
    per unit of a new mode's velocity amplitude, in √kg: where Σ|force z| > N it lifts.
    shares (m, 3): parts of decay_per_s that are its own, the contacts' loss, the partners'.
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    passes: tuple[Array, ...]
    force_n_s: Array
    shares: Array


def in_place(body: Moving, partners: Sequence[Moving], touches: Sequence[Touch]) -> InPlace:
    """What a body becomes at these touches. None of them: what it is free, turn the identity."""
    raise NotImplementedError


class KeptPlaces:
    """`in_place`, with the last results kept by bodies, touches and loads as they are given (quantise them)."""
