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
    area_m2 : (f,) of its triangles
    length_m : (f,) > 0, eigenvalues, ascending
    vector : (f, f) columns are eigenvectors, of √area·v
    """

    area_m2: Array
    length_m: Array
    vector: Array


MOST_UNEVEN, MOST_NEGATIVE = 0.4, 0.01
"""Limits on the solution: its antisymmetric part over the whole, and its least eigenvalue over its greatest. Good
panels have 0.03 to 0.33, thin discs most, and -0.005 at least; those that cross, touch or lie twice 0.4 and more, or
-0.04."""


def moved_air(corner_m: Array) -> Moved | None:
    """Solve the module's equations for triangles corner_m (f, 3, 3) of a closed surface, outward.

    Sphere moving as harmonic l: φ = a v/(l + 1). The map is symmetric by reciprocity and positive, as the energy of the
    air is; discretised, nearly so. Where it is not, triangles cross, touch or lie twice, and None is returned.
    """
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
    uneven = np.linalg.norm(found - found.T) > MOST_UNEVEN * np.linalg.norm(found)
    if uneven or value[0] < -MOST_NEGATIVE * value[-1]:
        return None
    return Moved(area, np.maximum(value, 1e-2 * root.min()), vector)


@njit(nogil=True)
def _matrices(corner, normal, beta):
    """Build ½ - K - βD and S + β(½ + K'), both (f, f)."""
    count = len(corner)
    left = np.empty((count, count))
    right = np.empty((count, count))
    across = np.empty((3, 3))
    for j in range(count):
        n0, n1, n2 = normal[j]
        edge_m = np.empty(3)
        for e in range(3):
            t0, t1, t2 = corner[j, (e + 1) % 3] - corner[j, e]
            edge_m[e] = np.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            across[e, 0] = (t1 * n2 - t2 * n1) / edge_m[e]
            across[e, 1] = (t2 * n0 - t0 * n2) / edge_m[e]
            across[e, 2] = (t0 * n1 - t1 * n0) / edge_m[e]
        for i in range(count):
            x0 = (corner[i, 0, 0] + corner[i, 1, 0] + corner[i, 2, 0]) / 3
            x1 = (corner[i, 0, 1] + corner[i, 1, 1] + corner[i, 2, 1]) / 3
            x2 = (corner[i, 0, 2] + corner[i, 1, 2] + corner[i, 2, 2]) / 3
            a0, a1, a2 = x0 - corner[j, 0, 0], x1 - corner[j, 0, 1], x2 - corner[j, 0, 2]
            b0, b1, b2 = x0 - corner[j, 1, 0], x1 - corner[j, 1, 1], x2 - corner[j, 1, 2]
            c0, c1, c2 = x0 - corner[j, 2, 0], x1 - corner[j, 2, 1], x2 - corner[j, 2, 2]
            ra = np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
            rb = np.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
            rc = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
            ab, bc, ca = a0 * b0 + a1 * b1 + a2 * b2, b0 * c0 + b1 * c1 + b2 * c2, c0 * a0 + c1 * a1 + c2 * a2
            angle = 0.0
            if i != j:
                triple = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0)
                angle = 2 * np.arctan2(triple, ra * rb * rc + ab * rc + bc * ra + ca * rb)
            height = n0 * a0 + n1 * a1 + n2 * a2
            potential = -height * angle
            i0, i1, i2 = normal[i]
            slope = -(n0 * i0 + n1 * i1 + n2 * i2) * angle
            loop = 0.0
            for e in range(3):
                if e == 0:
                    p0, p1, p2, q0, q1, q2, rp, rq, pq = a0, a1, a2, b0, b1, b2, ra, rb, ab
                elif e == 1:
                    p0, p1, p2, q0, q1, q2, rp, rq, pq = b0, b1, b2, c0, c1, c2, rb, rc, bc
                else:
                    p0, p1, p2, q0, q1, q2, rp, rq, pq = c0, c1, c2, a0, a1, a2, rc, ra, ca
                m0, m1, m2 = across[e]
                near = np.log((rp + rq + edge_m[e]) / (rp + rq - edge_m[e]))
                potential -= (m0 * p0 + m1 * p1 + m2 * p2) * near
                slope -= (m0 * i0 + m1 * i1 + m2 * i2) * near
                turn = i0 * (p1 * q2 - p2 * q1) + i1 * (p2 * q0 - p0 * q2) + i2 * (p0 * q1 - p1 * q0)
                loop += turn * (rp + rq) / (rp * rq * (rp * rq + pq))
            left[i, j] = (-angle + beta * loop) / (4 * np.pi)
            right[i, j] = (potential + beta * slope) / (4 * np.pi)
        left[j, j] += 0.5
        right[j, j] += 0.5 * beta
    return left, right
