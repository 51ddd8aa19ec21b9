"""Modes of a body for every isotropic material, in one reduced basis (made by reduced.py).

K(E, ν) = E [ l(ν) K_l + s(ν) K_s ],   l = ν/((1+ν)(1−2ν)),  s = 1/(2(1+ν))
    [Hughes 1987, ch. 2.7]
(l VᵀK_lV + s VᵀK_sV) q = θ q,  λ = γ θ/L²,  γ = E/ρ, lengths by the body's diagonal L

How modes move when the body is longer along one of its axes, from the modes on its surface alone:
x -> x + ε a (a·x), u of unit mass, free surface:
    dλ/dε = ∮ (σ:ε − λρ|u|²) (a·n)(a·x) dS     [Hadamard's formula: Haug, Choi & Komkov 1986, ch. 3.3]
    σ:ε = E/(1−ν²) [e₁² + e₂² + 2ν e₁e₂ + ½(1−ν) g²]   of the strains in the surface, as no stress leaves it

Over three axes ∂ ln λ/∂ε sums to −2, as λ ∝ 1/L²: each mode's values are scaled to it, which takes most of the error of
the surface's elements. Clamps are taken to be small.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.geometry.nearest_point import closest_point
from sonic_bullet.records import Array, TouchedSurface


@dataclass(frozen=True, slots=True, eq=False)
class Family:
    """Modes of a body for every γ = E/ρ and ν.

    Attributes
    ----------
    lame, shear : (b, b)
        Reduced stiffness.
    skin : (v, 3, b) float32
        The basis on the surface at ρL³ = 1 kg.
    vertex_m, face : (v, 3), (4t, 3)
        The surface, each element's face cut in four.
    length_m
        Diagonal L.
    count
        How many of the lowest modes are true.
    meshed
        False where λ carries no element's error.
    error
        Estimated relative error of the highest frequency, NaN where it is not known.
    curvature_per_m : (4t,)
        Of the surface, as of `ModalModel`; so is touched.
    """

    lame: Array
    shear: Array
    skin: Array
    vertex_m: Array
    face: Array
    length_m: float
    volume_m3: float
    count: int
    note: str
    meshed: bool = True
    error: float = float("nan")
    curvature_per_m: Array = field(default_factory=lambda: np.zeros(0))
    touched: TouchedSurface | None = None

    def modes(self, gamma_m2_s2: float, poisson: float) -> tuple[Array, Array]:
        """Compute λ (m,) in 1/s², ascending, and the modes (b, m) in the basis; `points` turns them into shapes."""
        value, vector = np.linalg.eigh(_stiffness(self, poisson))
        return value[: self.count] * gamma_m2_s2 / self.length_m**2, vector[:, : self.count]

    def slope(self, poisson: float, vector: Array) -> Array:
        """Compute ∂ ln λ/∂ν (m,) of modes (b, m) at ν, λ' = qᵀK'q [Hellmann-Feynman]."""
        lame = (1 + 2 * poisson**2) / ((1 + poisson) ** 2 * (1 - 2 * poisson) ** 2)
        shear = -1 / (2 * (1 + poisson) ** 2)
        bent = (vector * ((lame * self.lame + shear * self.shear) @ vector)).sum(axis=0)
        return np.asarray(bent / (vector * (_stiffness(self, poisson) @ vector)).sum(axis=0))

    def points(self, position_m: Array, direction: Array) -> tuple[Array, Array]:
        """Evaluate the basis (k, b) at surface points along directions, and how far off (k,) in m the points lie.

        The surface points are those nearest to position_m (k, 3), the directions (k, 3). Divide by √(ρL³) for shapes
        per √kg. Quadratic over each element's face, as the elements themselves are.
        """
        face, weight, distance = closest_point(self.vertex_m, self.face, np.asarray(position_m, float))
        moved = np.empty((len(face), *self.skin.shape[1:]))
        for i, (f, w) in enumerate(zip(face, weight, strict=True)):
            node, share = _quadratic(self.face[f // 4 * 4 : f // 4 * 4 + 4], int(f % 4), w)
            moved[i] = np.tensordot(share, self.skin[node].astype(float), 1)
        return np.einsum("kxb,kx->kb", moved, direction), distance


def _stiffness(family: Family, poisson: float) -> Array:
    return np.asarray(mix_stiffness(poisson, family.lame, family.shear))


def _quadratic(quarters: Array, which: int, weight: Array) -> tuple[Array, Array]:
    """Return the six nodes of an element's face and their shape functions.

    They are taken at barycentric ``weight`` of one of its quarters (see solid.QUARTERS).
    """
    middle = quarters[3]
    node = np.array([quarters[0, 0], quarters[1, 1], quarters[2, 2], *middle])
    # of nodes 0-2, then edges 01, 12, 20
    corner = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
    place = {int(n): corner[k] for k, n in enumerate(node)}
    a, b, c = weight @ np.array([place[int(n)] for n in quarters[which]])
    return node, np.array([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a])


def mix_stiffness(poisson: float, lame: Any, shear: Any) -> Any:
    """Combine the stiffness at E = 1 from its two parts, dense or sparse."""
    return poisson / ((1 + poisson) * (1 - 2 * poisson)) * lame + shear / (2 * (1 + poisson))


def stretch_slopes(family: Family, poisson: float) -> Array:
    """Compute ∂ ln λ/∂ ln length (m, 3) of a family's modes at ν along the body's axes, shortest first.

    They are the principal axes of its surface's vertices.
    """
    value, vector = family.modes(family.length_m**2, poisson)
    shown = np.einsum("vxb,bm->vxm", family.skin.astype(float), vector)
    quarter = family.face.reshape(-1, 4, 3)  # of each element's face, see Family.points
    node = np.concatenate([quarter[:, [0, 1, 2], [0, 1, 2]], quarter[:, 3]], axis=1)
    at = family.vertex_m - family.vertex_m.mean(axis=0)
    axis = np.linalg.eigh(at.T @ at)[1]
    made = np.zeros((3, len(value)))
    outward = 0.0
    for weight, share, slope in _points():
        place, tangent = share @ at[node], np.einsum("kn,fnx->kfx", slope, at[node])
        normal = np.cross(tangent[0], tangent[1])  # as long as dS over the reference triangle's
        along = weight / 2 * (normal @ axis) * (place @ axis)  # (f, 3): (a·n)(a·x) dS
        outward += along.sum()
        metric = np.einsum("kfx,lfx->fkl", tangent, tangent)
        inverse = np.linalg.inv(metric)
        u, by = np.einsum("n,fnxm->fxm", share, shown[node]), np.einsum("kn,fnxm->kfxm", slope, shown[node])
        strain = np.einsum("kfxm,lfx->fklm", by, tangent)
        strain = np.einsum("fjk,fklm->fjlm", inverse, (strain + strain.transpose(0, 2, 1, 3)) / 2)  # one index raised
        total = np.einsum("fjjm->fm", strain)
        both = np.einsum("fjkm,fkjm->fm", strain, strain)
        energy = (poisson * total**2 + (1 - poisson) * both) / (1 - poisson**2)
        made += along.T @ (energy * family.length_m**2 / value - (u**2).sum(axis=1))
    made *= np.sign(outward) / family.length_m**3
    return np.asarray((made * (-2 / made.sum(axis=0))).T)


def _points() -> Iterator[tuple[float, Array, Array]]:
    """Yield weights, quadratic shape functions (6,) and their slopes (2, 6) at six points of a triangle.

    Exact to the fourth degree.                                                        [Dunavant 1985, table II, p = 4]
    """
    for weight, b in ((0.223381589678011, 0.445948490915965), (0.109951743655322, 0.091576213509771)):
        for x, y in ((b, b), (1 - 2 * b, b), (b, 1 - 2 * b)):
            z = 1 - x - y
            share = [z * (2 * z - 1), x * (2 * x - 1), y * (2 * y - 1), 4 * z * x, 4 * x * y, 4 * y * z]
            by_x = [1 - 4 * z, 4 * x - 1, 0, 4 * (z - x), 4 * y, -4 * y]
            by_y = [1 - 4 * z, 0, 4 * y - 1, -4 * x, 4 * x, 4 * (z - y)]
            yield weight, np.array(share), np.array([by_x, by_y])
