"""Sizes of elements: from a budget of unknowns, and smaller where a thin wall is curved."""

from __future__ import annotations

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.records import Array


def dof_budget(thickness_m: float, diagonal_m: float) -> int:
    """Return the unknowns spent by default on a body of thickness 2V/A: fewer the chunkier, more for very thin plates.

    A quadratic element of edge e bends correctly while e² « thickness x wavelength, so the number of elements in a
    plate grows as 1/thickness.
    """
    thin_dof, chunky_dof = 26_000, 10_000  # unknowns by default: a plate's factor stays sparse, a ball's does not
    more = np.clip(0.007 * diagonal_m / thickness_m, 1, 3)
    return int((thin_dof + (chunky_dof - thin_dof) * chunkiness(thickness_m, diagonal_m)) * more)


def chunkiness(thickness_m: float, diagonal_m: float) -> float:
    """Rate slabs and bars (thickness 2V/A < 4 % of the diagonal) 0, lumps (> 7 %; a ball has 19 %) 1."""
    return float(np.clip((thickness_m / diagonal_m - 0.04) / 0.03, 0, 1))


def edge_within_m(volume_m3: float, thickness_m: float, tets: float) -> float:
    """Return the edge that keeps a body within a number of tetrahedra: they are ≈ 9 V/e³ + 2 A/e², A = 2V/thickness."""
    edges = thickness_m * np.geomspace(0.4, 20, 200)
    made = 9 * volume_m3 / edges**3 + 4 * volume_m3 / thickness_m / edges**2
    return float(edges[min(199, int((made > tets).sum()))])


def curved_sizes(vertex_m: Array, face: Array, edge_m: float) -> tuple[Array, Array]:
    """Find points (k, 3) of a closed surface whose bent walls need elements below edge_m, and their size (k,)."""
    least_edge = 0.25  # of the wanted edge: where the surface is bent as sharply as a crease
    curvature = np.abs(geometry.face_curvature(vertex_m, face))
    wall = wall_m(vertex_m, face)
    # edge on a wall of thickness t and radius r, over √(r t): chords of both sides deviate by a quarter of the wall,
    # and at twice this they touch
    curved_factor = 1.5
    size = np.maximum(curved_factor * np.sqrt(wall / np.maximum(curvature, 1e-300)), least_edge * edge_m)
    bent = np.flatnonzero(size < edge_m)
    return spread_points(vertex_m[face[bent]], size[bent])


def spread_points(corner: Array, size: Array) -> tuple[Array, Array]:
    """Spread points (k, 3) over faces of corners (f, 3, 3), about size (f,) apart, and return each one's size (k,)."""
    most_along = 40  # points at which a size is given, along a face's longest side
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    along = np.clip(np.ceil(longest / size), 1, most_along).astype(int)
    points, sizes = [np.zeros((0, 3))], [np.zeros(0)]
    for count in np.unique(along):
        mine = along == count
        part = np.array([(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
        points.append(np.einsum("pc,fcx->fpx", part, corner[mine]).reshape(-1, 3))
        sizes.append(np.repeat(size[mine], len(part)))
    return np.concatenate(points), np.concatenate(sizes)


def wall_m(vertex_m: Array, face: Array) -> Array:
    """Compute how far behind each face (f,) of a closed surface its other side is; infinite for no thin wall."""
    centre, normal = vertex_m[face].mean(axis=1), geometry.outward_normals(vertex_m, face)
    found, _, distance = geometry.closest_point(vertex_m, face, centre, -normal)
    opposite = np.einsum("fx,fx->f", geometry.outward_normals(vertex_m, face)[found], normal) < 0
    return np.where(opposite, distance, np.inf)
