"""Large flat faces of a body, which mirror sound: rectangles, or rectangles of the same area and middle.

A face is one where its shorter side holds a wave of 1.4 kHz; sound of longer waves passes round its edges, and the
image that stands for the face [Pierce 1989, sec. 5-1] is up to 6 dB too loud for these.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.geometry.components import label_components
from sonic_bullet.geometry.triangles import face_areas_m2, outward_normals, weld_vertices
from sonic_bullet.geometry.turns import rotation_matrix
from sonic_bullet.records import Array, Shape

SHORTEST_SIDE_M = 0.25


def flat_faces(shapes: Sequence[Shape]) -> Array:
    """Find the faces (k, 3, 3) of shapes in their body's frame: middle, then two half sides whose product is outward.

    Capsules and spheres have none.
    """
    found = [np.zeros((0, 3, 3))]
    for shape in shapes:
        turn = rotation_matrix(shape.quaternion_xyzw)
        own = _own_faces(shape)
        if len(own):
            placed = own @ turn.T
            placed[:, 0] += shape.position_m
            found.append(placed)
    faces = np.concatenate(found)
    return np.asarray(faces[2 * np.linalg.norm(faces[:, 1:], axis=2).min(axis=1) >= SHORTEST_SIDE_M])


def _own_faces(shape: Shape) -> Array:
    """Find the faces (k, 3, 3) of a shape in its own frame."""
    x, y, z = np.eye(3)
    unbounded_m = 1e6  # half a side of a plane
    if shape.kind == "plane":
        return np.array([[np.zeros(3), unbounded_m * x, unbounded_m * y]])
    if shape.kind == "box":
        a, b, c = shape.size_m / 2
        ends = [[c * z, a * x, b * y], [a * x, b * y, c * z], [b * y, c * z, a * x]]
        return np.array([one for face in ends for one in (face, [-face[0], face[2], face[1]])])
    if shape.kind == "cylinder":
        radius, length = shape.size_m[:2]
        side = radius * np.sqrt(np.pi) / 2
        return np.array([[length / 2 * z, side * x, side * y], [-length / 2 * z, side * y, side * x]])
    return _mesh_faces(shape.vertex_m, shape.face) if shape.kind == "mesh" else np.zeros((0, 3, 3))


def _mesh_faces(vertex_m: Array, face: Array) -> Array:
    """Join neighbouring triangles of one plane to rectangles (k, 3, 3)."""
    vertex_m, face = weld_vertices(vertex_m, face)
    area, normal = face_areas_m2(vertex_m, face), outward_normals(vertex_m, face)
    edge = np.sort(np.stack([face, np.roll(face, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort(edge.T)
    same = np.flatnonzero((edge[order][1:] == edge[order][:-1]).all(axis=1))
    one, other = order[same] // 3, order[same + 1] // 3
    same_plane = 1e-3  # radians within which triangles face one way
    level = 1 - same_plane**2 / 2
    flat = np.einsum("ei,ei->e", normal[one], normal[other]) > level
    label = label_components(len(face), one[flat], other[flat])
    found = []
    for piece in np.flatnonzero(np.bincount(label, area) >= SHORTEST_SIDE_M**2):
        mine = np.flatnonzero(label == piece)
        first = mine[np.argmax(area[mine])]
        mine = mine[normal[mine] @ normal[first] > level]  # triangles of a finely cut bend turn little by little
        if area[mine].sum() >= SHORTEST_SIDE_M**2:
            made = _rectangle(vertex_m[np.unique(face[mine])], normal[first], float(area[mine].sum()))
            found += [made] if made is not None else []
    return np.array(found).reshape(-1, 3, 3)


def _rectangle(point_m: Array, normal: Array, area_m2: float) -> Array | None:
    """Fit the smallest rectangle round points (n, 3) of a plane, (3, 3); None where the face fills too little of it.

    One side of it lies on a side of the hull [Freeman, Shapira, Comm. ACM 18(7), 1975].
    """
    from scipy.spatial import ConvexHull, QhullError

    axis = np.eye(3)[np.argmin(abs(normal))]
    u = np.cross(normal, axis) / np.linalg.norm(np.cross(normal, axis))
    v = np.cross(normal, u)
    flat = point_m @ np.array([u, v]).T
    try:
        hull = flat[ConvexHull(flat).vertices]
    except QhullError:
        return None
    side = np.roll(hull, -1, axis=0) - hull
    angle = np.arctan2(side[:, 1], side[:, 0])
    turn = np.moveaxis(np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]), 2, 0)
    turned = hull @ turn.swapaxes(1, 2)
    low, high = turned.min(axis=1), turned.max(axis=1)
    best = int(np.argmin((high - low).prod(axis=1)))
    filled = area_m2 / float((high - low)[best].prod())
    filled_share = 0.7  # fraction of its bounding rectangle that a face fills at least: a disc has π/4
    if filled < filled_share:
        return None
    middle = turn[best].T @ ((low + high)[best] / 2)
    half = (high - low)[best] / 2 * np.sqrt(min(filled, 1.0))
    axes = turn[best] @ np.array([u, v])
    centre = middle @ np.array([u, v]) + normal * float(normal @ point_m[0])
    return np.array([centre, half[0] * axes[0], half[1] * axes[1]])
