"""Air that moves with a vibrating surface: the exterior Laplace problem, once a body, for all its modes.

    Δφ = 0 outside, ∂φ/∂n = -v on the surface, φ → 0 far away;
        near field p = iωρ₀φ: φ is the length of air moved, times v

    (½ - K) φ = S v          S v = ∮ v/4πr dS,  K φ = ∮ φ ∂(1/4πr)/∂n_y dS            [Kress 1989, eq. 6.23]
    -D φ = (½ + K') v        their derivatives along n_x                              [Burton & Miller 1971, eq. 3.5]

First plus β times second, β = √(S/4π): the first fixes the constant. The second adds how two sides of a thin wall act
on each other, which the first alone loses. Triangles of constant φ and v, collocated at their centroids; all integrals
in closed form, by the engine (src/radiation/panels.hpp). f triangles, m modes.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class PotentialMap:
    """Map v → φ of one surface, symmetric in √area: φ = Σ_j vector_j length_j (vector_j·v).

    Attributes
    ----------
    corner_m : (f, 3, 3) of its triangles
    area_m2 : (f,) of these
    length_m : (f,) > 0, eigenvalues, ascending
    vector : (f, f) columns are eigenvectors, of √area·v
    """

    corner_m: Array
    area_m2: Array
    length_m: Array
    vector: Array


def moved_air(corner_m: Array) -> PotentialMap | None:
    """Solve the module's equations for triangles corner_m (f, 3, 3) of a closed surface, outward.

    Sphere moving as harmonic l: φ = a v/(l + 1). The map is symmetric by reciprocity and positive, as the energy of the
    air is; discretised, nearly so. Where it is not, triangles cross, touch or lie twice, and None is returned.
    """
    # Limits on the solution: its antisymmetric part over the whole, and its least eigenvalue over its greatest. Good
    # panels have 0.03 to 0.33, thin discs most, and -0.005 at least; those that cross, touch or lie twice 0.4 and more,
    # or -0.04.
    most_uneven, most_negative = 0.4, 0.01
    twice = np.cross(corner_m[:, 1] - corner_m[:, 0], corner_m[:, 2] - corner_m[:, 0])
    length = np.linalg.norm(twice, axis=1)
    normal = twice / length[:, None]
    area = length / 2
    root = np.sqrt(area)
    try:
        left, right = _matrices(
            np.ascontiguousarray(corner_m, dtype=float), normal, float(np.sqrt(area.sum() / (4 * np.pi)))
        )
        found = root[:, None] * np.linalg.solve(left, right) / root
        finite = np.isfinite(found).all()
        if not finite or np.linalg.norm(found - found.T) > most_uneven * np.linalg.norm(found):
            return None
        value, vector = np.linalg.eigh((found + found.T) / 2)
    except np.linalg.LinAlgError:
        return None
    if value[0] < -most_negative * value[-1]:
        return None
    return PotentialMap(corner_m, area, np.maximum(value, 1e-2 * root.min()), vector)


def static_kernels(corner_m: Array, normal: Array) -> Array:
    """Compute 4π times S, K, K', D at k = 0 (4, f, f), [j, i] of triangle j at the centroid of i."""
    made = np.empty((4, len(corner_m), len(corner_m)))
    _engine.static_kernels(corner_m, normal, made)
    return made


def _matrices(corner: Array, normal: Array, beta: float) -> tuple[Array, Array]:
    """Build ½ - K - βD and S + β(½ + K'), both (f, f)."""
    s, k, across, d = static_kernels(corner, normal).transpose(0, 2, 1)
    left, right = (-k - beta * d) / (4 * np.pi), (s + beta * across) / (4 * np.pi)
    left[np.diag_indices(len(corner))] += 0.5
    right[np.diag_indices(len(corner))] += 0.5 * beta
    return left, right
