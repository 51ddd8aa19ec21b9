"""What strikes: a small ball of a mass, whose stiffness sets how long the contact lasts, by the run time's own law.

A finger's pad, its knuckle and a stick's end differ by their moduli: tissue has 0.05 to 1 MPa, with the bone behind it
more [Johnson 1985, sec. 4; Serina, Mote & Rempel 1997, J. Biomech. 30(10)]. Sticks are wood across the grain, metal is
steel. Speeds are those of tapping by hand, 0.1 to 1.5 m/s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Material


@dataclass(frozen=True, slots=True)
class StrikerRange:
    """Ranges of a kind: modulus in Pa, density in kg/m³, radius of the tip in m, moving mass in kg; loss factor."""

    youngs_pa: tuple[float, float]
    density_kg_m3: float
    radius_m: tuple[float, float]
    mass_kg: tuple[float, float]
    poisson: float = 0.3
    restitution: float = 0.5


STRIKERS: Mapping[str, StrikerRange] = {
    "finger": StrikerRange((2e5, 2e7), 1100.0, (0.006, 0.01), (0.006, 0.03), 0.45, 0.3),
    "stick": StrikerRange((5e8, 2e9), 700.0, (0.003, 0.012), (0.005, 0.05), 0.35, 0.5),
    "metal": StrikerRange((1.9e11, 2.1e11), 7850.0, (0.002, 0.01), (0.005, 0.06), 0.29, 0.7),
}
SPEED_M_S = (0.1, 1.5)


@dataclass(frozen=True, slots=True)
class Striker:
    """A striker that was drawn."""

    kind: str
    youngs_pa: float
    density_kg_m3: float
    radius_m: float
    mass_kg: float
    poisson: float
    restitution: float

    def material(self) -> Material:
        """Return its material, without loss of its own: it does not ring."""
        return Material.isotropic(
            self.kind, youngs_pa=self.youngs_pa, poisson=self.poisson, density_kg_m3=self.density_kg_m3,
            alpha_per_s=0.0, beta_s=0.0, restitution=self.restitution,
        )  # fmt: skip


HARD = Striker("point", 2e11, 7850.0, 0.001, 0.002, 0.29, 0.7)
"""Of a set without contact time: small, light and hard, so that its pulse lasts some 10 µs."""


def draw_striker(rng: np.random.Generator, kind: str) -> Striker:
    """Draw a striker of a kind."""
    of = STRIKERS[kind]
    modulus, radius, mass = (
        float(np.exp(rng.uniform(*np.log(between)))) for between in (of.youngs_pa, of.radius_m, of.mass_kg)
    )
    return Striker(kind, modulus, of.density_kg_m3, radius, mass, of.poisson, of.restitution)
