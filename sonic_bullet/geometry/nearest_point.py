"""Nearest point of a triangle surface, exact, a few microseconds each: a tree of boxes built once per body.

    nearest in a triangle by its Voronoi regions       [Ericson, Real-Time Collision Detection (2005), ch. 5.1.5]
    depth-first search of a binary tree of bounding boxes, nearer child first          [ibid., ch. 6.3]

PyBullet collides a mesh as its convex hull, and a thin wall has two sides a hair apart: of the faces nearly as near as
the nearest, one that looks the same way as the contact's normal is preferred. On an edge faces are equally near but for
rounding: the one that looks most that way is taken, so that the answer does not hang on how the world is turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

LEAF = 4
# A face that looks the right way may be this much farther than the nearest: twice as far, plus a wall's thickness 2V/A,
# at
# most this part of the surface's diagonal (a point on the lid of a bowl is far from both, one in a thin wall near
# both).
WALL_PART = 0.03
# Faces whose distances differ by less than this part of the surface's diagonal are equally near.
TIE_PART = 1e-7
# Least cosine at which a face looks along the normal: not one at right angles, but for rounding.
LOOKS = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceIndex:
    """A surface ready for `nearest`: corner_m (f, 3, 3) and normal (f, 3) in tree order, ``order`` (f,) the faces' own
    numbers, low_m, high_m (k, 3) boxes of the nodes, child (k, 2): both children, or (−start−1, end) of a leaf. wall_m:
    see WALL_PART."""

    corner_m: Array
    normal: Array
    order: Array
    low_m: Array
    high_m: Array
    child: Array
    wall_m: float


def surface_index(vertex_m: Array, face: Array) -> SurfaceIndex:
    """Build the tree over vertex_m (v, 3), face (f, 3). Raises MeshError where there is no face."""
    if len(face) == 0:
        raise MeshError("surface without triangles has no nearest point", "give the body a model with a surface")
    corner = np.ascontiguousarray(np.asarray(vertex_m, float)[face])
    order, low, high, child = _grow(corner.min(axis=1), corner.max(axis=1), corner.mean(axis=1))
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
    wall = min(4 * volume / max(float(length.sum()), 1e-300), WALL_PART * float(np.linalg.norm(high[0] - low[0])))
    normal = vector / np.where(length > 0, length, 1)[:, None]
    return SurfaceIndex(
        np.ascontiguousarray(corner[order]), np.ascontiguousarray(normal[order]), order, low, high, child, wall
    )


def nearest(index: SurfaceIndex, points_m: Array, normals: Array | None = None) -> tuple[Array, Array, Array]:
    """Face (k,), barycentric coordinates (k, 3) and distance (k,) in m of the surface point nearest to each of points_m
    (k, 3).

    normals (k, 3): the outward normal the surface should have there, or None; a face with normal·n > 0 is taken if it
    is at most twice as far as the nearest one plus a wall's thickness.
    """
    points = np.ascontiguousarray(points_m, float).reshape(-1, 3)
    wanted = np.zeros_like(points) if normals is None else np.ascontiguousarray(normals, float).reshape(-1, 3)
    face, barycentric, distance = _search(
        index.corner_m, index.normal, index.low_m, index.high_m, index.child, index.wall_m, points, wanted
    )
    return index.order[face], barycentric, distance


def closest_point(
    vertex_m: Array, face: Array, points: Array, normals: Array | None = None
) -> tuple[Array, Array, Array]:
    """`nearest` on a surface given plainly: builds the tree for this one call."""
    return nearest(surface_index(vertex_m, face), points, normals)


@njit(nogil=True)
def _grow(low: Array, high: Array, centre: Array) -> tuple[Array, Array, Array, Array]:
    """Boxes and children of a balanced tree: each node's faces split at the median of their longest axis."""
    count = len(low)
    order = np.arange(count)
    most = 2 * count + 1
    node_low, node_high = np.empty((most, 3)), np.empty((most, 3))
    child = np.empty((most, 2), np.int64)
    start, end = np.empty(most, np.int64), np.empty(most, np.int64)
    start[0], end[0] = 0, count
    made, done = 1, 0
    while done < made:
        a, b = start[done], end[done]
        for x in range(3):
            lowest, highest = np.inf, -np.inf
            for i in range(a, b):
                lowest, highest = min(lowest, low[order[i], x]), max(highest, high[order[i], x])
            node_low[done, x], node_high[done, x] = lowest, highest
        if b - a <= LEAF:
            child[done, 0], child[done, 1] = -a - 1, b
        else:
            axis, widest = 0, -1.0
            for x in range(3):
                lowest, highest = np.inf, -np.inf
                for i in range(a, b):
                    lowest, highest = min(lowest, centre[order[i], x]), max(highest, centre[order[i], x])
                if highest - lowest > widest:
                    axis, widest = x, highest - lowest
            part = order[a:b].copy()
            order[a:b] = part[np.argsort(centre[part, axis], kind="mergesort")]
            middle = (a + b) // 2
            child[done, 0], child[done, 1] = made, made + 1
            start[made], end[made], start[made + 1], end[made + 1] = a, middle, middle, b
            made += 2
        done += 1
    return order, node_low[:made].copy(), node_high[:made].copy(), child[:made].copy()


@njit(nogil=True)
def _in_triangle(p: Array, abc: Array) -> tuple[float, float, float]:  # noqa: PLR0911 - one return a Voronoi region
    """Barycentric coordinates of the triangle's point nearest to p [Ericson 2005, p. 141]."""
    ab0, ab1, ab2 = abc[1, 0] - abc[0, 0], abc[1, 1] - abc[0, 1], abc[1, 2] - abc[0, 2]
    ac0, ac1, ac2 = abc[2, 0] - abc[0, 0], abc[2, 1] - abc[0, 1], abc[2, 2] - abc[0, 2]
    ap0, ap1, ap2 = p[0] - abc[0, 0], p[1] - abc[0, 1], p[2] - abc[0, 2]
    d1, d2 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2, ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    bp0, bp1, bp2 = p[0] - abc[1, 0], p[1] - abc[1, 1], p[2] - abc[1, 2]
    d3, d4 = ab0 * bp0 + ab1 * bp1 + ab2 * bp2, ac0 * bp0 + ac1 * bp1 + ac2 * bp2
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0 and d1 > d3:
        v = d1 / (d1 - d3)
        return 1 - v, v, 0.0
    cp0, cp1, cp2 = p[0] - abc[2, 0], p[1] - abc[2, 1], p[2] - abc[2, 2]
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


@njit(nogil=True)
def _box_gap(p: Array, low: Array, high: Array) -> float:
    gap = 0.0
    for x in range(3):
        d = max(low[x] - p[x], 0.0, p[x] - high[x])
        gap += d * d
    return gap


@njit(nogil=True)
def _search(
    corner: Array, normal: Array, low: Array, high: Array, child: Array, wall: float, points: Array, wanted: Array
) -> tuple[Array, Array, Array]:
    count = len(points)
    face, barycentric, distance = np.empty(count, np.int64), np.empty((count, 3)), np.empty(count)
    stack, gaps = np.empty(128, np.int64), np.empty(128)
    tie = TIE_PART * np.sqrt(((high[0] - low[0]) ** 2).sum())
    for k in range(count):
        p, n = points[k], wanted[k]
        any_face, any2 = 0, np.inf  # nearest of all
        # of those that look along n: the chosen one, its distance, n·normal; the least distance
        same_face, same, along, least = -1, np.inf, 0.0, np.inf
        ask = n[0] != 0 or n[1] != 0 or n[2] != 0
        top = 1
        stack[0], gaps[0] = 0, 0.0
        while top > 0:
            top -= 1
            node, gap = stack[top], gaps[top]
            reach2 = (2 * np.sqrt(any2) + wall) ** 2
            if gap >= any2 and not (ask and gap < min((least + tie) ** 2, reach2)):
                continue
            if child[node, 0] >= 0:
                left, right = child[node, 0], child[node, 1]
                gap_left, gap_right = _box_gap(p, low[left], high[left]), _box_gap(p, low[right], high[right])
                if gap_left <= gap_right:
                    stack[top], gaps[top], stack[top + 1], gaps[top + 1] = right, gap_right, left, gap_left
                else:
                    stack[top], gaps[top], stack[top + 1], gaps[top + 1] = left, gap_left, right, gap_right
                top += 2
                continue
            for i in range(-child[node, 0] - 1, child[node, 1]):
                u, v, w = _in_triangle(p, corner[i])
                d2 = 0.0
                for x in range(3):
                    d = u * corner[i, 0, x] + v * corner[i, 1, x] + w * corner[i, 2, x] - p[x]
                    d2 += d * d
                if d2 < any2:
                    any_face, any2 = i, d2
                looks = n[0] * normal[i, 0] + n[1] * normal[i, 1] + n[2] * normal[i, 2]
                if ask and looks > LOOKS:
                    d = np.sqrt(d2)
                    if d < least - tie or (d <= least + tie and looks > along + 1e-9):
                        same_face, same, along = i, d, looks
                    least = min(least, d)
        chosen = any_face
        if ask and same_face >= 0 and same <= 2 * np.sqrt(any2) + wall:
            chosen = same_face
        u, v, w = _in_triangle(p, corner[chosen])
        face[k], distance[k] = chosen, same if chosen == same_face else np.sqrt(any2)
        barycentric[k, 0], barycentric[k, 1], barycentric[k, 2] = u, v, w
    return face, barycentric, distance
