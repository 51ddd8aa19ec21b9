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

from sonic_bullet._engine import FACE, NODE, nearest_points
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

# Least cosine at which a face looks along the normal: not one at right angles, but for rounding.
LOOKS = 1e-6


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
    order, nodes = _grown(corner.min(axis=1), corner.max(axis=1), corner.mean(axis=1))
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
    diagonal = float(np.linalg.norm(nodes["high_m"][0] - nodes["low_m"][0]))
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


def _grown(low: Array, high: Array, centre: Array) -> tuple[Array, Array]:
    """Build a balanced tree over the faces' boxes low, high and centres (f, 3), level by level.

    Returns the order (f,) of the faces and NODE (k,). Each node's faces are split at the median of their longest axis,
    in their present order.
    """
    leaf = 4
    order = np.arange(len(low))
    start, end = np.zeros(1, np.int64), np.array([len(low)])
    levels, made = [], 1
    while len(start):
        count = end - start
        at = np.cumsum(count) - count  # of each node's first face among those of this level
        place = np.repeat(start - at, count) + np.arange(int(count.sum()))
        here = order[place]
        nodes = np.zeros(len(start), NODE)
        nodes["low_m"], nodes["high_m"] = np.minimum.reduceat(low[here], at), np.maximum.reduceat(high[here], at)
        nodes["child"] = np.stack([-start - 1, end], axis=1)
        inner = np.flatnonzero(count > leaf)
        nodes["child"][inner] = made + 2 * np.arange(len(inner))[:, None] + [0, 1]
        made += 2 * len(inner)
        levels.append(nodes)
        width = np.maximum.reduceat(centre[here], at) - np.minimum.reduceat(centre[here], at)
        node = np.repeat(np.arange(len(start)), count)
        along = np.where(count > leaf, np.argmax(width, axis=1), -1)[node]  # a leaf's faces stay as they are
        order[place] = here[np.lexsort((np.where(along < 0, 0.0, centre[here, along]), node))]
        start, middle, end = start[inner], (start[inner] + end[inner]) // 2, end[inner]
        start, end = np.stack([start, middle], axis=1).ravel(), np.stack([middle, end], axis=1).ravel()
    return order, np.concatenate(levels)


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _in_triangle(px, py, pz, face):  # noqa: PLR0911 - one return a Voronoi region
    """Compute barycentric coordinates of the triangle's point nearest to p [Ericson 2005, p. 141]."""
    abc = face.corner_m
    a0, a1, a2 = abc[0, 0], abc[0, 1], abc[0, 2]
    b0, b1, b2 = abc[1, 0], abc[1, 1], abc[1, 2]
    c0, c1, c2 = abc[2, 0], abc[2, 1], abc[2, 2]
    ab0, ab1, ab2 = b0 - a0, b1 - a1, b2 - a2
    ac0, ac1, ac2 = c0 - a0, c1 - a1, c2 - a2
    ap0, ap1, ap2 = px - a0, py - a1, pz - a2
    d1, d2 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2, ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    bp0, bp1, bp2 = px - b0, py - b1, pz - b2
    d3, d4 = ab0 * bp0 + ab1 * bp1 + ab2 * bp2, ac0 * bp0 + ac1 * bp1 + ac2 * bp2
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        v = d1 / (d1 - d3)
        return 1 - v, v, 0.0
    cp0, cp1, cp2 = px - c0, py - c1, pz - c2
    d5, d6 = ab0 * cp0 + ab1 * cp1 + ab2 * cp2, ac0 * cp0 + ac1 * cp1 + ac2 * cp2
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0 and d2 > d6:
        w = d2 / (d2 - d6)
        return 1 - w, 0.0, w
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / max((d4 - d3) + (d5 - d6), 1e-300)
        return 0.0, 1 - w, w
    total = va + vb + vc
    if total <= 0:  # a sliver whose area rounds to nothing
        return 1.0, 0.0, 0.0
    return 1 - vb / total - vc / total, vb / total, vc / total


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _box_gap(px, py, pz, node):
    """Compute the squared distance of p from a box."""
    low, high = node.low_m, node.high_m
    x, y, z = (
        max(low[0] - px, 0.0, px - high[0]),
        max(low[1] - py, 0.0, py - high[1]),
        max(low[2] - pz, 0.0, pz - high[2]),
    )
    return x * x + y * y + z * z


@njit(nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def nearest_face(faces, face_at, nodes, node_at, wall_m, tie_m, p, n):
    """Find face, barycentric coordinates (three numbers) and distance in m of the point nearest to p on one body.

    Its faces and nodes begin at face_at and node_at; the face is counted from there. p, n: tuples of three numbers, n
    the outward normal that the surface should have, 0 for any.
    """
    deepest = 64  # boxes that wait in a search: a balanced tree of 2^64 faces leaves no more
    (px, py, pz), (nx, ny, nz) = p, n
    stack, gaps = np.empty(deepest, np.int64), np.empty(deepest)
    any_face, any2, any_u, any_v, any_w = 0, np.inf, 1.0, 0.0, 0.0  # nearest of all
    # of those that look along n: the chosen one, its distance, its place; its n·normal, the least distance
    same_face, same, same_u, same_v, same_w = -1, np.inf, 1.0, 0.0, 0.0
    along, least = 0.0, np.inf
    ask = nx != 0 or ny != 0 or nz != 0
    top = 1
    stack[0], gaps[0] = 0, 0.0
    while top > 0:
        top -= 1
        gap = gaps[top]
        reach = 2 * np.sqrt(any2) + wall_m
        if gap >= any2 and not (ask and gap < min((least + tie_m) * (least + tie_m), reach * reach)):
            continue
        child = nodes[node_at + stack[top]].child
        if child[0] >= 0:
            left, right = child[0], child[1]
            gap_left, gap_right = (
                _box_gap(px, py, pz, nodes[node_at + left]),
                _box_gap(px, py, pz, nodes[node_at + right]),
            )
            nearer = 1 if gap_left <= gap_right else 0  # visited first, on top of the stack
            stack[top + nearer], gaps[top + nearer] = left, gap_left
            stack[top + 1 - nearer], gaps[top + 1 - nearer] = right, gap_right
            top += 2
            continue
        for i in range(-child[0] - 1, child[1]):
            face = faces[face_at + i]
            u, v, w = _in_triangle(px, py, pz, face)
            corner, normal = face.corner_m, face.normal
            x = u * corner[0, 0] + v * corner[1, 0] + w * corner[2, 0] - px
            y = u * corner[0, 1] + v * corner[1, 1] + w * corner[2, 1] - py
            z = u * corner[0, 2] + v * corner[1, 2] + w * corner[2, 2] - pz
            d2 = x * x + y * y + z * z
            if d2 < any2:
                any_face, any2, any_u, any_v, any_w = i, d2, u, v, w
            looks = nx * normal[0] + ny * normal[1] + nz * normal[2]
            if ask and looks > LOOKS:
                d = np.sqrt(d2)
                if d < least - tie_m or (d <= least + tie_m and looks > along + 1e-9):
                    along, same_face, same, same_u, same_v, same_w = looks, i, d, u, v, w
                least = min(least, d)
    if ask and same_face >= 0 and same <= 2 * np.sqrt(any2) + wall_m:
        return same_face, same_u, same_v, same_w, same
    return any_face, any_u, any_v, any_w, np.sqrt(any2)
