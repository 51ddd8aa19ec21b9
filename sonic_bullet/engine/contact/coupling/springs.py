"""Stiffness and loss of a contact, from its region, the materials and the load.

    K_c: a region with half-axes a >= b acts as the flat punch of its outline    `hertz`
    a, b   of a point and a line under the load: `hertz`; K_c = (6 E*² R N)^{1/3} of a ball
        of a face that of the geometry; rectangles as the ellipse of their area and aspect
    K_r = N/u₀,  u₀ = h/2                     roughness in series, h rms of both    [Persson 2007, PRL 99, 125502]
    1/K = (1/K_c + 1/K_r)/(1 + jη),  K_t/K = 2(1 − ν)/(2 − ν)          [Mindlin 1949; Johnson 1985, eq. 7.42, 7.44]
    η = Σ η_i c_i/Σ c_i,  c_i = (1 − ν_i²)/E_i        loss by each material's fraction of the compliance, 1/E* = Σ c_i
    pad    K = EA/h, sideways GA/h

For increments about a load the region of that load is constant [Barber 2003, Proc. R. Soc. A 459, 53]. Asperities are
of the same two materials, with the same loss. η is a constant, as in the handbooks: the Rayleigh law of wood, made for
an object's modes, would lose a third of a cycle's energy at 17 kHz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sonic_bullet._engine import PERSSON
from sonic_bullet.engine.contact.hertz import line_half_width_m, point_half_axes_m, punch_stiffness_n_m
from sonic_bullet.records import Material
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.errors import RecordError
from sonic_bullet.signal.elementary import symmetric_eigenpairs


@dataclass(frozen=True, slots=True)
class ContactSide:
    """Properties of one body in a contact.

    modulus_pa: E as it is pressed (wood: across the grain); loss_factor: η.
    """

    modulus_pa: float
    poisson: float
    loss_factor: float
    roughness_m: float

    @classmethod
    def of(cls, material: Material) -> ContactSide:
        """Take a material's properties in a contact.

        Its softest axis, and its least Rayleigh loss, 2√(αβ), none where that is not known.
        """
        stiffness, strain = symmetric_eigenpairs(material.stiffness_pa)
        softest = float(1 / (strain[:3] ** 2 / stiffness).sum(axis=1).max())  # of the inverse's diagonal
        alpha, beta = material.alpha_per_s, material.beta_s
        loss = 0.0 if alpha is None or beta is None else 2 * float(np.sqrt(alpha * beta))
        return cls(softest, material.poisson, loss, material.roughness_m)

    @property
    def compliance_per_pa(self) -> float:
        """Compliance (1 − ν²)/E."""
        return (1 - self.poisson**2) / self.modulus_pa


@dataclass(frozen=True, slots=True)
class Region:
    """Contact region of two bodies, along two axes in their tangent plane.

    half_m: how far they conform, 0 where they curve away from each other at once; curvature_per_m: κ of both together,
    unused where they conform. A ball on a plane: (0, 0), (κ, κ); a rod that lies on it: (L/2, 0), (0, 1/R); a box:
    (l/2, w/2), (0, 0).
    """

    half_m: tuple[float, float]
    curvature_per_m: tuple[float, float]

    def __post_init__(self) -> None:
        """Check that each axis has a half-length or a curvature."""
        for half, curvature in zip(self.half_m, self.curvature_per_m, strict=True):
            if not (0 < half < np.inf or (half == 0 and 0 < curvature < np.inf)):
                raise RecordError(
                    f"a region of touching with half-length {half} m and curvature {curvature} 1/m along one axis",
                    "give a half-length above zero, or 0 and a curvature above zero",
                )

    def half_axes_m(self, modulus_pa: float, load_n: float) -> tuple[float, float]:
        """Compute a >= b in m of the ellipse that touches under a load. modulus_pa: E*."""
        square = 2 / math.sqrt(math.pi)  # half-axes of an ellipse over those of the rectangle that has its area
        if not any(self.half_m):
            return point_half_axes_m(self.curvature_per_m, modulus_pa, load_n)
        a, b = self.half_m
        if not all(self.half_m):
            curved = self.curvature_per_m[0 if a == 0 else 1]
            a, b = max(a, b), line_half_width_m(max(a, b), curved, modulus_pa, load_n)
        return square * max(a, b), square * min(a, b)


@dataclass(frozen=True, slots=True)
class ContactSpring:
    """Complex stiffness in N/m for e^{jωt}, ω > 0: along the normal, and across it."""

    normal_n_m: complex
    tangential_n_m: complex

    def share(self, part: float) -> ContactSpring:
        """Return the spring of a fraction of the region, for several points in one."""
        return ContactSpring(self.normal_n_m * part, self.tangential_n_m * part)


def contact_spring(region: Region, sides: tuple[ContactSide, ContactSide], load_n: float) -> ContactSpring:
    """Compute the whole region's spring under the whole load in N. Raises RecordError for a load not above zero."""
    load = as_number(load_n, "load of a contact", "give a load above zero", above=0)
    one, other = sides
    first, second = one.compliance_per_pa, other.compliance_per_pa
    whole = first + second
    a, b = region.half_axes_m(1 / whole, load)
    smooth = punch_stiffness_n_m(a, b, whole)
    layer_m = PERSSON * math.hypot(one.roughness_m, other.roughness_m)
    loss = (first * one.loss_factor + second * other.loss_factor) / whole
    normal = (1 + 1j * loss) / (1 / smooth + layer_m / load)
    poisson = (first * one.poisson + second * other.poisson) / whole
    return ContactSpring(normal, normal * 2 * (1 - poisson) / (2 - poisson))
