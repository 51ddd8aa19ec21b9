"""Thermoelastic loss of metals: bending warms one side of a wall, cools the other, and the heat that flows is lost.

    η = (α²T/C) ∫ ½ h (Δσ)²/12 F(h √(ω/2χ)) dA / λ,    Δσ = E/(1−ν) (e − e′),    χ = k/C,    C = ρ c
        [Zener 1937, Phys. Rev. 52, 230; of a wall by its stresses' trace: Norris & Photiadis 2005, Q. J. Mech. Appl.
        Math. 58, 143]
    F(ξ) = 6/ξ² − (6/ξ³)(sinh ξ + sin ξ)/(cosh ξ + cos ξ)           [Lifshitz & Roukes 2000, Phys. Rev. B 61, 5600]

e: dilatation of the surface under a mode u with uᵀMu = 1, whose strain energy is λ/2; E/(1−ν) e is there the trace of
the stress, since nothing presses on a free surface. e′: the same across the wall, along the inward normal, h away. Each
side takes half of the wall. Where ξ is large F is 6/ξ² and the integral that of (∇σ)², whatever h is; so solid bodies,
which are far above their peak at all audible frequencies, need no wall. No number is free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np

from sonic_bullet.effects.protocol import Effect, Number, Owner, Stage, sort_modes
from sonic_bullet.geometry.nearest_point import nearest, surface_index
from sonic_bullet.geometry.triangles import area_vectors_m2, face_areas_m2
from sonic_bullet.records import Array, ModalModel


@dataclass(frozen=True)
class ThermoelasticLoss(Effect):
    """Loss by heat that flows through bent walls; adds to what the material loses otherwise."""

    id: ClassVar[str] = "thermoelastic"
    stage: ClassVar[Stage] = Stage.MODES
    owner: ClassVar[Owner] = Owner.MATERIAL
    reference: ClassVar[str] = "Zener 1937; Lifshitz & Roukes 2000; Norris & Photiadis 2005"

    youngs_pa: Annotated[float, Number("E of the isotropic material", least=0.0, shown=False)]
    poisson: Annotated[float, Number("ν", shown=False)]
    density_kg_m3: Annotated[float, Number("ρ", least=0.0, shown=False)]
    expansion_per_k: Annotated[float, Number("α, linear", least=0.0)]
    conductivity_w_m_k: Annotated[float, Number("k", least=0.0)]
    heat_capacity_j_kg_k: Annotated[float, Number("c", least=0.0)]

    @property
    def strength(self) -> float:
        """Zener's relaxation strength of a beam, Δ = Eα²T/C."""
        room_k = 293.15  # Temperature of bodies, 20 °C
        return self.youngs_pa * self.expansion_per_k**2 * room_k / (self.density_kg_m3 * self.heat_capacity_j_kg_k)

    @property
    def diffusivity_m2_s(self) -> float:
        """Thermal diffusivity χ = k/C."""
        return self.conductivity_w_m_k / (self.density_kg_m3 * self.heat_capacity_j_kg_k)

    def loss_of_beam(self, thickness_m: Array, omega_per_s: Array) -> Array:
        """Compute η of a slender beam of that thickness in bending [Lifshitz & Roukes 2000, eq. 40]."""
        return self.strength * relaxation(thickness_m * np.sqrt(omega_per_s / (2 * self.diffusivity_m2_s)))

    def loss_factors(self, x: ModalModel) -> Array:
        """Compute η (m,) of a body's modes by the equation of the module's head."""
        height, across = walls(x.vertex_m, x.face)
        lam = x.omega0_squared_per_s2
        root = np.sqrt(np.sqrt(lam) / (2 * self.diffusivity_m2_s))
        area = face_areas_m2(x.vertex_m, x.face)
        bent = dilatations(x.vertex_m, x.face, x.shape)
        bent = np.where(across[:, None] >= 0, bent - bent[across], 0.0)
        whole = np.einsum("f,fm,fm->m", area * height / 24, bent**2, relaxation(height[:, None] * root))
        return np.asarray(self.strength * self.youngs_pa / (1 - self.poisson) ** 2 * whole / lam)

    def apply(self, x: ModalModel) -> ModalModel:
        """Add the loss to the decays of a body's modes, d = ηω/2."""
        if not x.mode_count or not self.strength or not self.conductivity_w_m_k:
            return x
        omega = np.sqrt(x.omega0_squared_per_s2)
        decay = np.minimum(x.decay_per_s + 0.5 * self.loss_factors(x) * omega, 0.99 * omega)
        return sort_modes(x, np.sqrt(omega**2 - np.nan_to_num(decay) ** 2) / (2 * np.pi), decay)


def relaxation(xi: Array) -> Array:
    """Compute F(ξ) of the module's head; ξ²/5 where ξ is small, 6/ξ² − 6/ξ³ where it is large."""
    small, large = 0.1, 40.0
    x = np.clip(np.asarray(xi, float), small, large)
    fall = np.exp(-x)  # of both hyperbolic functions' e^x, which is left out above and below
    ratio = (1 - fall**2 + 2 * fall * np.sin(x)) / (1 + fall**2 + 2 * fall * np.cos(x))
    wide = np.maximum(xi, small)
    return np.where(np.less(xi, small), np.square(xi) / 5, 6 / wide**2 - 6 * ratio / wide**3)


def dilatations(vertex_m: Array, face: Array, shape: Array) -> Array:
    """Compute the surface's dilatation ∇ₛ·u (f, m) in each triangle, of displacements (v, 3, m) linear within it."""
    a, b, c = np.moveaxis(vertex_m[face], 1, 0)
    normal = np.cross(b - a, c - a)
    square = np.maximum((normal**2).sum(axis=1), 1e-300)[:, None]
    found = np.zeros((len(face), shape.shape[2]))
    for corner, edge in enumerate((c - b, a - c, b - a)):
        gradient = np.cross(normal, edge) / square
        found += np.einsum("fx,fxm->fm", gradient, shape[face[:, corner]])
    return found


def walls(vertex_m: Array, face: Array) -> tuple[Array, Array]:
    """Measure the wall behind each triangle's middle, along its inward normal: h (f,) in m, and the triangle there.

    −1 and h 0 where the ray ends nowhere. A surface of another size has the same walls, and they are measured once.
    """
    extent = float(np.linalg.norm(np.ptp(vertex_m, axis=0)))
    unit = np.round((vertex_m - vertex_m.mean(axis=0)) / extent, 9) + 0.0  # + 0: a zero without a sign
    height, across = _unit_walls(unit.tobytes(), np.ascontiguousarray(face, np.int64).tobytes())
    return height * extent, across


@lru_cache(maxsize=16)
def _unit_walls(vertex_bytes: bytes, face_bytes: bytes) -> tuple[Array, Array]:
    """Return `walls` of a surface of extent 1, by steps as long as the surface is far [sphere tracing, Hart 1996]."""
    most, begin, close = 200, 1e-4, 1e-5  # steps; the first; where the ray has ended
    vertex = np.frombuffer(vertex_bytes).reshape(-1, 3)
    face = np.frombuffer(face_bytes, np.int64).reshape(-1, 3)
    index = surface_index(vertex, face)
    middle = vertex[face].mean(axis=1)
    normal = area_vectors_m2(vertex, face)
    size = np.linalg.norm(normal, axis=1)
    inward = -normal / np.maximum(size, 1e-300)[:, None]
    depth = np.full(len(face), begin)
    height, across = np.zeros(len(face)), np.full(len(face), -1)
    inside = np.flatnonzero(size > 0)
    for _ in range(most):
        if not len(inside):
            break
        at, _, far = nearest(index, middle[inside] + depth[inside, None] * inward[inside])
        out = (far < close) & ((inward[at] * inward[inside]).sum(axis=1) < 0)
        height[inside[out]], across[inside[out]] = depth[inside[out]] + far[out], at[out]
        depth[inside] += np.maximum(far, 0.5 * close)
        inside = inside[~out & (depth[inside] < 1.0)]
    for array in (height, across):
        array.setflags(write=False)
    return height, across
