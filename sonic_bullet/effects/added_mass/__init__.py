"""`added-mass`: a sensor, a blob of wax, water: a small mass attached at one point.

    (Λ − λ (1 + Φᵀ m' Φ)) q = 0,  Φ = (φ(p), √(λ_r R)) (3, n + 3)      to first order Δλ/λ = −m |φ(p)|²
        [Rayleigh 1894, § 88-90; modal synthesis]

R is the compliance of the modes above the band at the point, along its normal and across: residual attachment modes far
above them [Rubin 1975]. Without it the point is too stiff, and its higher modes come out several per cent high.
Identified by frequencies and patterns together: for points all over the surface and masses up to a sixth of the body's,
lines are paired with the loaded body's modes anew; the pairs that agree best are taken, where they agree better than
the bare body's. E/ρ was fitted to lines that the mass had lowered, so the common scale of all frequencies is fitted
with it, on the bare body as well: λ(Λ e^{2s}, R e^{−2s}) = e^{2s} λ(Λ, R). So is ν: torsion and bending had been
lowered differently. A free body moves against the mass as a whole (free_body.py): m' in m's place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from sonic_bullet.effects.added_mass.free_body import FreeBody
from sonic_bullet.effects.added_mass.mass_loaded_modes import attach_modes, load_modes
from sonic_bullet.effects.common.points import nearest, vertex_normals
from sonic_bullet.effects.protocol import (
    ActsAtPlaces,
    BaselineChange,
    ChangesBaseline,
    Cost,
    Mixing,
    Number,
    Owner,
    Stage,
    Traits,
)
from sonic_bullet.records import ModalModel


@dataclass(frozen=True)
class AddedMass(ChangesBaseline, ActsAtPlaces):
    """A point mass on the surface, and what was fitted of the bare body with it."""

    id: ClassVar[str] = "added-mass"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.FIXTURE
    reference: ClassVar[str] = "Rayleigh 1894, § 88-90; Rubin 1975"
    traits: ClassVar[Traits] = Traits(moves_modes=True, mixing=Mixing.ALL, cost=Cost.COSTLY)

    position_m: Annotated[tuple[float, float, float], Number("(3,), in the mesh's frame", free=1)]
    mass_kg: Annotated[float, Number("the mass", least=0.0, free=1)]
    yield_m_n: Annotated[
        tuple[float, float], Number("(2,), m/N, of the modes above: along, across", least=0.0, free=1)
    ] = (0.0, 0.0)
    stretch: Annotated[float, Number("ln of the bare body's frequencies over the baseline's", free=1)] = 0.0
    poisson_ratio: Annotated[float | None, Number("ν of the bare body, None: the baseline's", free=1)] = None

    def apply(self, x: ModalModel) -> ModalModel:
        """Compute the modes of the body with the mass."""
        if not x.mode_count or self.mass_kg == 0:
            return x
        at = nearest(x, self.position_m)
        return load_modes(
            x,
            attach_modes(x.shape[at].astype(float), vertex_normals(x)[at], self.yield_m_n, x),
            self.mass_kg,
            x.vertex_m[at],
            FreeBody.of(x),
        )

    def baseline_change(self) -> BaselineChange:
        """Return E/ρ and ν of the bare body, found with the mass."""
        return BaselineChange(stretch=self.stretch, poisson_ratio=self.poisson_ratio)

    def places(self) -> tuple[tuple[float, float, float], ...]:
        """Return the mass's place."""
        return (self.position_m,)
