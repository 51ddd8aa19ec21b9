"""Mesh files of collision shapes in their own frame and unit, split into objects as Bullet does; convex hulls."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.files import meshes
from sonic_bullet.files.meshes import MeshSurface
from sonic_bullet.geometry import closest_point, weld_vertices
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

__all__ = ["MeshSurface", "hull", "join_surfaces", "lid_height_m", "read_surfaces"]


def read_surfaces(path: Path) -> list[MeshSurface]:
    """Read the objects of a mesh file, (vertices (v, 3), faces (f, 3)) each, identical vertices merged.

    Raises
    ------
    FileError, MeshError
        The file cannot be read or holds no triangle.
    """
    whole = [weld_vertices(vertex, face) for vertex, face in meshes.read_surfaces(path) if len(face)]
    whole = [(vertex, face) for vertex, face in whole if len(face) and np.isfinite(vertex).all()]
    if not whole:
        raise MeshError(f"mesh file '{path.name}' holds no triangle", "export it again")
    return whole


def join_surfaces(surfaces: list[MeshSurface]) -> MeshSurface:
    """Join all surfaces: (v, 3), (f, 3)."""
    offset = np.cumsum([0] + [len(vertex) for vertex, _ in surfaces])
    return np.concatenate([v for v, _ in surfaces]), np.concatenate(
        [f + o for (_, f), o in zip(surfaces, offset, strict=False)]
    )


def hull(vertex_m: Array) -> MeshSurface:
    """Compute the convex hull of points (v, 3), faces outward.

    Raises
    ------
    MeshError
        The points lie in a plane.
    """
    from scipy.spatial import ConvexHull, QhullError

    try:
        shell = ConvexHull(vertex_m)
    except (QhullError, ValueError) as error:
        raise MeshError("a collision mesh is flat or empty", "give it thickness, or pass mesh=") from error
    face = shell.simplices.copy()
    a, b, c = (vertex_m[face[:, k]] for k in range(3))
    inward = (np.cross(b - a, c - a) * shell.equations[:, :3]).sum(axis=1) < 0
    face[inward] = face[inward][:, ::-1]
    used = np.unique(face)
    return vertex_m[used], np.searchsorted(used, face)


def lid_height_m(vertex_m: Array, face: Array) -> float:
    """Return the largest distance of the convex hull from the surface: the depth of a bowl, 0 for a convex body.

    Sampled on a grid of lid_grid points a side on each triangle of the hull.
    """
    lid_grid = 5
    try:
        shell_m, shell = hull(vertex_m)
    except MeshError:
        return 0.0
    i, j = (part.ravel() for part in np.meshgrid(np.arange(lid_grid), np.arange(lid_grid)))
    inside = i + j < lid_grid
    share = np.stack([i, j, lid_grid - 1 - i - j], axis=1)[inside] / (lid_grid - 1)
    point = np.unique(np.einsum("gc,fcx->fgx", share, shell_m[shell]).reshape(-1, 3), axis=0)
    return float(closest_point(vertex_m, face, point)[2].max())
