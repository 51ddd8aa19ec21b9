"""Stiffness and loss of a contact, from the region of touching, the materials and the load.

    K_c = π E* a / 𝐊(e),  e² = 1 − (b/a)²     a region with half-axes a >= b acts like the flat punch of its outline
        [Green & Sneddon 1950; a circle: 2E*a, Johnson 1985, Contact Mechanics, eq. 3.36]
    point  a = b = (3NR/4E*)^{1/3}            K_c = (6 E*² R N)^{1/3}               [Johnson 1985, eq. 4.22]
    line   b = √(4NR/πE*L),  a = L/2          N/L on each metre of it               [Johnson 1985, eq. 4.43]
    face   a, b of the geometry
    K_r = N/u₀,  u₀ = h/2                     roughness in series, h rms of both    [Persson 2007, PRL 99, 125502]
    1/K = 1/K_c + 1/K_r,  K_t/K = 2(1 − ν)/(2 − ν)                     [Mindlin 1949; Johnson 1985, eq. 7.42 and 7.44]
    K(1 + jη),  η = Σ η_i c_i/Σ c_i,  c_i = (1 − ν_i²)/E_i             loss by each material's share of the compliance
    pad    K = EA/h, sideways GA/h

η is a constant, as the handbooks' are: Rayleigh's β of a material fits the modes of an object and would give a third at
17 kHz. Increments about a load: stiffness of the touching region as it is [Barber 2003, Proc. R. Soc. A 459, 53].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Material
from sonic_bullet.records.coerce import as_number

PERSSON = 0.5
"""u₀ over rms roughness: 0.4 to 0.5 of self-affine surfaces [Persson 2007; Akarapu, Sharp & Robbins 2011]."""


@dataclass(frozen=True, slots=True)
class ContactSide:
    """One body's part in a contact. modulus_pa: of E, as it is pressed (across the grain); loss_factor: η."""

    modulus_pa: float
    poisson: float
    loss_factor: float
    roughness_m: float

    @classmethod
    def of(cls, material: Material) -> ContactSide:
        """What a material is where it is touched: its softest axis, and its least Rayleigh loss 2√(αβ)."""
        softest = float(1 / np.diag(np.linalg.inv(material.stiffness_pa))[:3].max())
        loss = 2 * float(np.sqrt((material.alpha_per_s or 0.0) * (material.beta_s or 0.0)))
        return cls(softest, material.poisson, loss, material.roughness_m)

    @property
    def compliance_per_pa(self) -> float:
        """(1 − ν²)/E"""
        return (1 - self.poisson**2) / self.modulus_pa


@dataclass(frozen=True, slots=True)
class Region:
    """Where two bodies touch, along two axes in their tangent plane. half_m: how far they conform, 0 where they curve
    apart at once; curvature_per_m: κ of both together, 0 where they conform. A ball: (0, 0), (κ, κ); a rod that lies on
    a plane: (L/2, 0), (0, 1/R); a box: (l/2, w/2), (0, 0).
    """

    half_m: tuple[float, float]
    curvature_per_m: tuple[float, float]


@dataclass(frozen=True, slots=True)
class ContactSpring:
    """Complex stiffness in N/m for e^{jωt}, ω > 0: along the normal, and across it."""

    normal_n_m: complex
    tangential_n_m: complex

    def share(self, part: float) -> ContactSpring:
        """The spring of a part of the region: what several points share."""
        return ContactSpring(self.normal_n_m * part, self.tangential_n_m * part)


def contact_spring(region: Region, sides: tuple[ContactSide, ContactSide], load_n: float) -> ContactSpring:
    """The whole region's spring under the whole load N in N. Raises RecordError for a load that is not above zero."""
    raise NotImplementedError


def pad_spring(modulus_pa: float, poisson: float, loss_factor: float, area_m2: float, height_m: float) -> ContactSpring:
    """The spring of a pad of felt or rubber: EA/h along its height, GA/h across [a short column, no bulging]."""
    area = as_number(area_m2, "area of a pad", "give an area above zero", above=0)
    height = as_number(height_m, "height of a pad", "give a height above zero", above=0)
    normal = as_number(modulus_pa, "modulus of a pad", "give a modulus above zero", above=0) * area / height
    lossy = normal * (1 + 1j * as_number(loss_factor, "loss factor of a pad", "give 0 or above", least=0))
    return ContactSpring(lossy, lossy / (2 * (1 + poisson)))
