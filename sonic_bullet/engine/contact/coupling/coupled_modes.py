"""Coupled modes of a body in contact with others, and what it transmits to them.

    BodyMobility (body, partners) + ContactPoint (points, springs) -> CoupledSystem -> first_order -> CoupledModes

One body is solved at a time, its partners as they are free of other contacts: a body on a body on a table moves as if
on the table's own modes alone; longer chains are not claimed.

Energy: ½|z|² of the new modes is that of the body and its touches' springs. A change of touches is an orthogonal map
of z, and no decay is below zero: no contact that begins or ends adds energy. A touch begins unstretched, and the energy
of one that ends stays with the body. (A spring attached at an old length would add without bound.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sonic_bullet.engine.contact.coupling.mobility import BodyMobility, BodyPoint
from sonic_bullet.engine.contact.coupling.springs import ContactSpring
from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import matrix_product


@dataclass(frozen=True, slots=True, eq=False)
class ContactPoint:
    """One point at which a body touches partner number ``partner``.

    own, other: the point on either, or its rows of Φ; spring: of this point alone.
    """

    partner: int
    own: BodyPoint | Array
    other: BodyPoint | Array
    spring: ContactSpring


@dataclass(frozen=True, slots=True, eq=False)
class CoupledModes:
    """A body in contact: m modes as before, mixed.

    Attributes
    ----------
    turn : (m, m) real, orthogonal: new modes in old ones, by columns; column k is what old mode k became
        The identity where they do not mix. State z, gains Uᵀj and shapes of the free modes become turnᵀ z, turnᵀ Uᵀj,
        Φ turn: ½|z|² stays what it is.
    omega_rad_s, decay_per_s : (m,) poles of the new modes; no decay is below 0
    motion : (m, m) real: the part of each old mode, turned, in each new mode's motion, by columns
    moved : for each partner (m_p, m) complex, its modes' velocity per velocity of each motion
        At most ½ in all: of two that meet at one frequency, each has the other's half.
    force_n_s : (c, m) amplitude of the normal force at each touch in N, for a velocity amplitude z of 1 of a new mode
        Where Σ|force z| exceeds the load the contact separates.
    shares : (m, 3) parts of decay_per_s that are its own, the contacts' loss, the partners'
    newton : (m,) whether the motion oscillates: no touch stops it
    """

    omega_rad_s: Array
    decay_per_s: Array
    turn: Array
    motion: Array
    moved: tuple[Array, ...]
    force_n_s: Array
    shares: Array
    newton: Array

    @property
    def transmissions(self) -> tuple[Array, ...]:
        """For each partner (m_p, m) complex, its modes' velocity per velocity of each new mode."""
        return tuple(matrix_product(moved, self.motion.T) for moved in self.moved)


class CoupledSystem(NamedTuple):
    """Matrices of a body and its partners at r springs.

    Attributes
    ----------
    own, other : Φ (r, N) of the body and (r, P) of all partners side by side
    spring : K (r,)
    lam, decay, other_lam, other_decay : λ, d of both
    plate, half_space : y₀, y₂ (r,)
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


def uncoupled_modes(body: BodyMobility, partners: Sequence[BodyMobility], touches: int = 0) -> CoupledModes:
    """Return a body's modes as they are without contacts, at so many touches that hold nothing."""
    m = len(body.omega_rad_s)
    return CoupledModes(
        body.omega_rad_s,
        body.decay_per_s,
        np.eye(m),
        np.eye(m),
        tuple(np.zeros((len(p.omega_rad_s), m), complex) for p in partners),
        np.zeros((touches, m)),
        np.stack([body.decay_per_s, np.zeros(m), np.zeros(m)], axis=1),
        np.ones(m, bool),
    )


def collect_springs(
    body: BodyMobility, partners: Sequence[BodyMobility], touches: Sequence[ContactPoint]
) -> tuple[CoupledSystem, Array]:
    """Collect all springs of all touches, and which of their (3c,) directions those are.

    A sliding touch has no tangential one.
    """
    begin = partner_columns(partners)
    own, of = body.moves([touch.own for touch in touches]), np.array([touch.partner for touch in touches])
    other = np.zeros((len(own), int(begin[-1])))
    for p, partner in enumerate(partners):
        at = np.flatnonzero(of == p)
        if len(at):
            here = (3 * at[:, None] + np.arange(3)).ravel()
            other[here, begin[p] : begin[p + 1]] = partner.moves([touches[i].other for i in at.tolist()])
    spring = np.array([(t.spring.normal_n_m, *2 * (t.spring.tangential_n_m,)) for t in touches], complex).ravel()
    return build_system(body, partners, TouchingMotions(own, other, spring, of))


def partner_columns(partners: Sequence[BodyMobility]) -> Array:
    """Return (partners + 1,) where the motions of each begin, of all side by side."""
    return np.cumsum([0, *(len(p.lam) for p in partners)])


class TouchingMotions(NamedTuple):
    """Motion at c touches, along the normal and both tangents of each, and their springs.

    own (3c, N), other (3c, P): Φ of the body and of all partners; spring (3c,); partner (c,): number of each.
    """

    own: Array
    other: Array
    spring: Array
    partner: Array


def build_system(
    body: BodyMobility, partners: Sequence[BodyMobility], touching: TouchingMotions
) -> tuple[CoupledSystem, Array]:
    """Build the system of the springs that are not zero, and return which of the (3c,) directions those are."""
    under = np.zeros((2, len(touching.partner), 3))
    under[:, :, 0] = np.array([(p.plate_m_n_s, p.half_space_m_s_n) for p in partners]).T[:, touching.partner]
    row = np.flatnonzero(touching.spring)
    whole = len(row) == len(touching.spring)
    own, other, spring = (one if whole else one[row] for one in touching[:3])
    made = CoupledSystem(
        own,
        other,
        spring,
        body.lam,
        body.decay,
        np.concatenate([p.lam for p in partners]),
        np.concatenate([p.decay for p in partners]),
        under[0].ravel()[row],
        under[1].ravel()[row],
    )
    return made, row
