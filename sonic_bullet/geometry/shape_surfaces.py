"""Triangles of shapes, for pictures and for meshes in files."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.geometry.turns import rotation_matrix
from sonic_bullet.records import Array, Shape


def shape_triangles(shape: Shape) -> tuple[Array, Array]:
    """Return vertices (v, 3) and faces (f, 3) of a shape in its own frame."""
    plane_m = 100.0  # Side of the square that stands for a plane
    from trimesh import creation

    x, y, _ = shape.size_m.tolist()
    if shape.kind == "mesh":
        return shape.vertex_m, shape.face
    if shape.kind == "sphere":
        made = creation.icosphere(subdivisions=3, radius=x)
    elif shape.kind == "cylinder":
        made = creation.cylinder(radius=x, height=y, sections=64)
    elif shape.kind == "capsule":
        made = creation.capsule(radius=x, height=y)
    else:
        made = creation.box(extents=shape.size_m if shape.kind == "box" else (plane_m, plane_m, 1e-3))
    vertex = np.array(made.vertices, float)
    # a capsule starts at its lower cap's centre in some releases
    return vertex - (np.ptp(vertex, axis=0) / 2 + vertex.min(axis=0)), np.asarray(made.faces)


def joined_triangles(shapes: Sequence[Shape]) -> tuple[Array, Array]:
    """Return vertices (v, 3) and faces (f, 3) of all shapes in their body's frame."""
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for shape in shapes:
        vertex, face = shape_triangles(shape)
        vertices.append(vertex @ rotation_matrix(shape.quaternion_xyzw).T + shape.position_m)
        faces.append(face + count)
        count += len(vertex)
    return np.concatenate(vertices), np.concatenate(faces)
