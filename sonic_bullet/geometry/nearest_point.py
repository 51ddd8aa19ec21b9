"""Nearest point of a triangle surface, exact, a few microseconds each: a tree of boxes built once per body.

    nearest in a triangle by its Voronoi regions       [Ericson, Real-Time Collision Detection (2005), ch. 5.1.5]
    depth-first search of a binary tree of bounding boxes, nearer child first          [ibid., ch. 6.3]

PyBullet collides a mesh as its convex hull, and a thin wall has two sides close together: of the faces nearly as near
as the nearest, one that faces the contact's normal is preferred. On an edge faces are equally near but for rounding:
the one that faces it most is taken, so that the answer does not depend on the world's orientation.

Surface -> FACE and NODE tables (numpy, level by level) -> nearest_face, one kernel for `nearest` and for the run time
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet._engine import FACE, NODE, grow_tree, nearest_points
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceIndex:
    """A surface ready for `nearest`.

    faces (f,) of FACE in tree order, ``order`` (f,) their own numbers, nodes (k,) of NODE; wall_m: the thinnest wall;
    tie_m: what counts as equally near.
    """

    faces: Array
    nodes: Array
    order: Array
    wall_m: float
    tie_m: float


def surface_index(vertex_m: Array, face: Array, curvature_per_m: Array | None = None) -> SurfaceIndex:
    """Build the tree over vertex_m (v, 3), face (f, 3), of faces with curvature_per_m (f,).

    Raises MeshError where there is no face.
    """
    if len(face) == 0:
        raise MeshError("surface without triangles has no nearest point", "give the body a model with a surface")
    corner = np.ascontiguousarray(np.asarray(vertex_m, float)[face])
    order, nodes = np.empty(len(face), np.int64), np.zeros(len(face), NODE)
    nodes = nodes[: grow_tree(corner.min(axis=1), corner.max(axis=1), corner.mean(axis=1), order, nodes)]
    vector = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(vector, axis=1)
    volume = abs(
        float(
            np.einsum(
                "ij,ij->",
                corner[:, 0] - corner[0, 0],
                np.cross(corner[:, 1] - corner[0, 0], corner[:, 2] - corner[0, 0]),
            )
        )
        / 6
    )
    diagonal = float(np.linalg.norm(nodes["high_m"][:1] - nodes["low_m"][:1], axis=1)[0])
    # a face that looks the right way may be this much farther than the nearest: twice as far, plus a wall's thickness
    # 2V/A, at most this part of the surface's diagonal (a point on the lid of a bowl is far from both, one in a thin
    # wall near both)
    wall_part = 0.03
    wall = min(4 * volume / max(float(length.sum()), 1e-300), wall_part * diagonal)
    faces = np.zeros(len(face), FACE)
    faces["corner_m"] = corner[order]
    faces["normal"] = (vector / np.where(length > 0, length, 1)[:, None])[order]
    faces["vertex"] = np.asarray(face)[order]
    if curvature_per_m is not None:
        faces["curvature_per_m"] = curvature_per_m[order]
    tie_part = 1e-7  # faces whose distances differ by less than this part of the surface's diagonal are equally near
    return SurfaceIndex(faces, nodes, order, wall, tie_part * diagonal)


def nearest(index: SurfaceIndex, points_m: Array, normals: Array | None = None) -> tuple[Array, Array, Array]:
    """Find the surface point nearest to each of points_m (k, 3).

    Returns face (k,), barycentric coordinates (k, 3) and distance (k,) in m. normals (k, 3): the outward normal the
    surface should have there, or None; a face with normal·n > 0 is taken if it is at most twice as far as the nearest
    one plus a wall's thickness.
    """
    points = np.ascontiguousarray(points_m, float).reshape(-1, 3)
    wanted = np.zeros_like(points) if normals is None else np.ascontiguousarray(normals, float).reshape(-1, 3)
    face, found = np.empty(len(points), np.int64), np.empty((len(points), 4))
    nearest_points(index.faces, index.nodes, index.wall_m, index.tie_m, points, wanted, face, found)
    return index.order[face], found[:, :3], found[:, 3]


def closest_point(
    vertex_m: Array, face: Array, points: Array, normals: Array | None = None
) -> tuple[Array, Array, Array]:
    """Run `nearest` on a plain surface: builds the tree for this one call."""
    return nearest(surface_index(vertex_m, face), points, normals)
