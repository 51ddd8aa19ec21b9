"""Split a mesh into convex collision pieces: hulls of connected parts where it moves, else its own surface.

    part closed and convex -> its hull;  moves -> its hull;  else -> its flat faces, each a hull without thickness,
                                                             or, where they are many, no pieces: a mesh of triangles

Bullet finds the penetration depth in a flat hull from either side. Of a mesh it tests each triangle by itself: a body
that penetrates a little also collides with the edges between the triangles of one floor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sonic_bullet.geometry import is_closed, label_components, volume_m3, weld_vertices
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import AnimationError, MeshError
from sonic_bullet.simulators.pybullet.urdf_meshes import hull

CONVEX = 0.02
"""Fraction of volume or area by which the hull of a convex part may be larger: rounded corners."""


def pieces(shape: Shape, name: str, moves: bool) -> list[Array]:
    """Return the corners (v, 3) of each piece; none where a static mesh has too many faces.

    Raises
    ------
    AnimationError
        A body that moves is flat.
    """
    most_pieces = 64  # most pieces of one body: with more, PyBullet takes longer than for triangles
    vertex, face = weld_vertices(shape.vertex_m, shape.face)
    parts = list(_connected_parts(vertex, face))
    if moves:
        solid = [own for own, _ in parts if len(own) >= 4]
        try:
            return [hull(own)[0] for own in (solid if 0 < len(solid) <= most_pieces else [vertex])]
        except MeshError as error:
            raise AnimationError(f"body '{name}': its mesh is flat", "give it thickness") from error
    found = [piece for part in parts for piece in _still(*part)]
    return found if len(found) <= most_pieces else []


def _connected_parts(vertex: Array, face: Array) -> Iterator[tuple[Array, Array]]:
    """Yield vertices and faces of each connected part."""
    label = label_components(len(vertex), face[:, [0, 1]].ravel(), face[:, [1, 2]].ravel())
    for one in np.unique(label[face[:, 0]]):
        yield _drop_unused(vertex, face[label[face[:, 0]] == one])


def _drop_unused(vertex: Array, face: Array) -> tuple[Array, Array]:
    used, numbered = np.unique(face, return_inverse=True)
    return vertex[used], numbered.reshape(-1, 3)


def _still(vertex: Array, face: Array) -> Iterator[Array]:
    """Yield the pieces of a static part."""
    try:
        corner, shell = hull(vertex)
        whole = volume_m3(corner, shell)
        if is_closed(face) and abs(volume_m3(vertex, face)) > (1 - CONVEX) * whole:
            yield corner
            return
    except MeshError:  # a flat one
        pass
    for own in _flat_faces(vertex, face):
        outline = _outline(vertex, own)
        yield from (vertex[one] for one in own) if outline is None else [outline]


def _flat_faces(vertex: Array, face: Array) -> Iterator[Array]:
    """Yield triangles (f, 3) that are connected by edges and lie in one plane."""
    flat_face = 1e-3  # Deviation of a flat face's corners, relative to its size
    a, b, c = (vertex[face[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    face, normal = face[area > 0], normal[area > 0] / area[area > 0, None]
    of_edge: dict[tuple[int, int], list[int]] = {}
    for number, one in enumerate(face.tolist()):
        for i, j in ((0, 1), (1, 2), (2, 0)):
            of_edge.setdefault((min(one[i], one[j]), max(one[i], one[j])), []).append(number)
    near: dict[int, set[int]] = {}
    for numbers in of_edge.values():
        for one in numbers:
            near.setdefault(one, set()).update(numbers)
    left = set(range(len(face)))
    while left:
        first = left.pop()
        plane, reached, ahead = normal[first], [first], [first]
        while ahead:
            for other in near[ahead.pop()] & left:
                if abs(normal[other] @ plane) > 1 - flat_face**2:
                    left.discard(other)
                    reached.append(other)
                    ahead.append(other)
        yield face[reached]


def _outline(vertex: Array, face: Array) -> Array | None:
    """Return the corners of a flat face's outline; None where it is not convex."""
    from scipy.spatial import ConvexHull, QhullError

    own, numbered = _drop_unused(vertex, face)
    middle = own - own.mean(axis=0)
    flat = middle @ np.linalg.svd(middle, full_matrices=False)[2][:2].T
    edge = flat[numbered[:, 1:]] - flat[numbered[:, :1]]
    area = np.abs(edge[:, 0, 0] * edge[:, 1, 1] - edge[:, 0, 1] * edge[:, 1, 0]).sum() / 2
    try:
        shell = ConvexHull(flat)
    except (QhullError, ValueError):
        return None
    return np.asarray(own[shell.vertices]) if shell.volume <= (1 + CONVEX) * area else None
