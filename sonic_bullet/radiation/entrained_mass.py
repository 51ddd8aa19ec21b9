"""Air that moves with a vibrating surface: the exterior Laplace problem, once a body, for all its modes.

    Δφ = 0 outside, ∂φ/∂n = -v on the surface, φ → 0 far away;
        near field p = iωρ₀φ: φ is the length of air moved, times v

    (½ - K) φ = S v          S v = ∮ v/4πr dS,  K φ = ∮ φ ∂(1/4πr)/∂n_y dS            [Kress 1989, eq. 6.23]
    -D φ = (½ + K') v        their derivatives along n_x                              [Burton & Miller 1971, eq. 3.5]

First plus β times second, β = √(S/4π): the first fixes the constant. The second adds how two sides of a thin wall act
on each other, which the first alone loses. Triangles of constant φ and v, collocated at their centroids; all integrals
in closed form: potential of a triangle [Wilton et al. 1984, eq. 5], solid angle [van Oosterom & Strackee 1983, eq. 8],
loop [Katz & Plotkin 2001, eq. 10.115]. f triangles, m modes.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Moved:
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


def moved_air(corner_m: Array) -> Moved | None:
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
        if not np.isfinite(found).all():
            return None
        value, vector = np.linalg.eigh((found + found.T) / 2)
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return None
    uneven = np.linalg.norm(found - found.T) > most_uneven * np.linalg.norm(found)
    if uneven or value[0] < -most_negative * value[-1]:
        return None
    return Moved(corner_m, area, np.maximum(value, 1e-2 * root.min()), vector)


@njit(nogil=True)
def panel(corner, normal, across, edge_m, x):
    """Integrate 1/r over a triangle, seen from x: potential, solid angle, gradient along x, loop of its edges.

    The gradient is the tangential one: the whole has -normal · solid angle, too. across (3, 3), edge_m (3,): of
    `panel_edges`.
    """
    p = np.empty((3, 3))
    r = np.empty(3)
    for e in range(3):
        p[e, 0], p[e, 1], p[e, 2] = x[0] - corner[e, 0], x[1] - corner[e, 1], x[2] - corner[e, 2]
        r[e] = np.sqrt(p[e, 0] * p[e, 0] + p[e, 1] * p[e, 1] + p[e, 2] * p[e, 2])
    height = normal[0] * p[0, 0] + normal[1] * p[0, 1] + normal[2] * p[0, 2]
    potential, whole, triple = 0.0, r[0] * r[1] * r[2], 0.0
    g0, g1, g2, l0, l1, l2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for e in range(3):
        a, b = p[e], p[(e + 1) % 3]
        ra, rb, m = r[e], r[(e + 1) % 3], across[e]
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        c0, c1, c2 = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
        near = np.log((ra + rb + edge_m[e]) / (ra + rb - edge_m[e]))
        potential -= (m[0] * a[0] + m[1] * a[1] + m[2] * a[2]) * near
        g0, g1, g2 = g0 - m[0] * near, g1 - m[1] * near, g2 - m[2] * near
        turn = (ra + rb) / (ra * rb * (ra * rb + ab))
        l0, l1, l2 = l0 + c0 * turn, l1 + c1 * turn, l2 + c2 * turn
        whole += ab * r[(e + 2) % 3]
        if e == 1:
            triple = p[0, 0] * c0 + p[0, 1] * c1 + p[0, 2] * c2
    angle = 2 * np.arctan2(triple, whole)
    return potential - height * angle, angle, height, g0, g1, g2, l0, l1, l2


@njit(nogil=True)
def panel_edges(corner, normal):
    """Compute of a triangle's edges the outward normals in its plane (3, 3) and the lengths (3,)."""
    across, edge_m = np.empty((3, 3)), np.empty(3)
    for e in range(3):
        t0, t1, t2 = corner[(e + 1) % 3] - corner[e]
        n0, n1, n2 = normal
        edge_m[e] = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
        across[e, 0] = (t1 * n2 - t2 * n1) / edge_m[e]
        across[e, 1] = (t2 * n0 - t0 * n2) / edge_m[e]
        across[e, 2] = (t0 * n1 - t1 * n0) / edge_m[e]
    return across, edge_m


@njit(nogil=True)
def static_kernels(corner, normal):
    """S, K, K', D at k = 0 times 4π (f, f, 4): [j, i] of triangle j at the centroid of i."""
    count = len(corner)
    made = np.empty((count, count, 4))
    x = np.empty(3)
    for j in range(count):
        n = normal[j]
        across, edge_m = panel_edges(corner[j], n)
        for i in range(count):
            for c in range(3):
                x[c] = (corner[i, 0, c] + corner[i, 1, c] + corner[i, 2, c]) / 3
            potential, angle, _, g0, g1, g2, l0, l1, l2 = panel(corner[j], n, across, edge_m, x)
            i0, i1, i2 = normal[i]
            if i == j:  # seen from its own plane: no solid angle, whatever the rounding
                angle = 0.0
            made[j, i, 0] = potential
            made[j, i, 1] = angle
            made[j, i, 2] = i0 * g0 + i1 * g1 + i2 * g2 - (n[0] * i0 + n[1] * i1 + n[2] * i2) * angle
            made[j, i, 3] = -(i0 * l0 + i1 * l1 + i2 * l2)
    return made


def _matrices(corner: Array, normal: Array, beta: float) -> tuple[Array, Array]:
    """Build ½ - K - βD and S + β(½ + K'), both (f, f)."""
    s, k, across, d = np.moveaxis(static_kernels(corner, normal), 2, 0).transpose(0, 2, 1)
    left, right = (-k - beta * d) / (4 * np.pi), (s + beta * across) / (4 * np.pi)
    left[np.diag_indices(len(corner))] += 0.5
    right[np.diag_indices(len(corner))] += 0.5 * beta
    return left, right
