"""Narrow strips along the creases of a triangulated side: what bends there dies out within √(R t) and a wall.

    along a crease each side's triangles draw back by a width, and a strip of two triangles an edge fills the gap

The sheet's normal turns by half the crease's angle within the first element, which is stiffer for it: that has to be
narrow. A bend decays as exp(−1.3 s/√(R t)) into a cylinder of radius R and wall t    [Timoshenko & Woinowsky-Krieger
1959, art. 114-116], the next strip follows that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.geometry import label_components
from sonic_bullet.records import Array


class StripMesh(NamedTuple):
    """Triangles with strips.

    Attributes
    ----------
    corner_m : (n, 3)
    triangle : (t, 3)
    strip : (q, 4) corners of the strips in turn round: along the crease, then back beside it; cut from the first to the
        third
    """

    corner_m: Array
    triangle: Array
    strip: Array


def with_strips(corner_m: Array, triangle: Array, crease: Array, width_m: list[float]) -> StripMesh:
    """Insert strips along the edges crease (e, 2): widths from outside to inside, each less than the one before."""
    made = StripMesh(corner_m, triangle, np.zeros((0, 4), np.int64))
    for width in width_m:
        made = _with_strip(made, crease, width)
    return made


def _with_strip(given: StripMesh, crease: Array, width_m: float) -> StripMesh:
    corner, triangle = given.corner_m, given.triangle
    line = {_pair(a, b) for a, b in crease.tolist()}
    sector, count = _sectors(triangle, line)
    moved, place = _drawn_back(corner, triangle, sector, _Bounds(line, count), width_m)
    changed = np.array([moved.get(int(s), int(v)) for s, v in zip(sector, triangle.ravel(), strict=True)]).reshape(
        -1, 3
    )
    strip: list[tuple[int, ...]] = []
    extra: list[tuple[int, ...]] = []
    for old, new in zip(triangle.tolist(), changed.tolist(), strict=True):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if _pair(old[a], old[b]) not in line:
                continue
            one = [(old[a], old[b], new[b])] if new[b] != old[b] else []
            two = [(old[a], new[b], new[a])] if new[a] != old[a] else []
            extra += one + two
            strip += [(old[a], old[b], new[b], new[a])] if one and two else []
    return StripMesh(
        np.concatenate([corner, place]),
        np.concatenate([changed, np.array(extra, np.int64).reshape(-1, 3)]),
        np.concatenate([_follow_triangles(given.strip, triangle, changed), np.array(strip, np.int64).reshape(-1, 4)]),
    )


class _Bounds(NamedTuple):
    """Creases, and how many triangles each edge has: one at the rim."""

    crease: set[tuple[int, int]]
    triangles: dict[tuple[int, int], int]


def _pair(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)


def _drawn_back(
    corner: Array, triangle: Array, sector: Array, bounds: _Bounds, width_m: float
) -> tuple[dict[int, int], Array]:
    """Return the new corner of each sector that draws back from its creases, and all their places (k, 3)."""
    most = 0.35  # of a triangle's height: how far it draws back
    into: dict[int, list[Array]] = {}  # of each sector: unit vectors in its triangles, at right angles to its creases
    rim: dict[int, Array] = {}  # of each sector that ends at the rim: along the rim
    height: dict[int, float] = {}
    for t, three in enumerate(triangle.tolist()):
        point, mine = corner[three], sector[3 * t : 3 * t + 3].tolist()
        across = np.cross(point[1] - point[0], point[2] - point[0])
        longest = max(float(np.linalg.norm(point[k] - point[k - 1])) for k in range(3))
        for a, b in ((0, 1), (1, 2), (2, 0)):
            height[mine[a]] = min(height.get(mine[a], np.inf), float(np.linalg.norm(across)) / longest)
            along = (point[b] - point[a]) / np.linalg.norm(point[b] - point[a])
            if _pair(three[a], three[b]) in bounds.crease:
                inward = np.cross(across, along) / np.linalg.norm(across)
                into.setdefault(mine[a], []).append(inward)
                into.setdefault(mine[b], []).append(inward)
            elif bounds.triangles[_pair(three[a], three[b])] == 1:
                rim[mine[a]], rim[mine[b]] = along, -along
    moved: dict[int, int] = {}
    place: list[Array] = []
    for label, inwards in sorted(into.items()):
        towards = _meet_creases(inwards, rim.get(label))
        if towards is not None:
            moved[label] = len(corner) + len(place)
            place.append(corner[triangle.ravel()[label]] + min(width_m, most * height[label]) * towards)
    return moved, np.array(place).reshape(-1, 3)


def _follow_triangles(strip: Array, triangle: Array, changed: Array) -> Array:
    """Return earlier strips (q, 4), whose corners on the crease draw back with their triangles."""
    if not len(strip):
        return strip
    back = {
        tuple(sorted(old)): dict(zip(old, new, strict=True))
        for old, new in zip(triangle.tolist(), changed.tolist(), strict=True)
    }
    followed = []
    for a, b, c, d in strip.tolist():
        corners = {**back[tuple(sorted((a, c, d)))], **back[tuple(sorted((a, b, c)))]}
        followed.append([corners[k] for k in (a, b, c, d)])
    return np.array(followed, np.int64)


def _meet_creases(normals: list[Array], rim: Array | None) -> Array | None:
    """Return where lines one beside creases of these inward normals meet; None where they do not."""
    least = 0.3  # cosine of the angle to the rim; of that between them, plus one
    if len(normals) == 1 and rim is not None:
        steep = float(normals[0] @ rim)
        return np.asarray(rim / steep) if steep > least else None
    if len(normals) != 2 or rim is not None or 1 + normals[0] @ normals[1] < least:
        return None
    return np.asarray((normals[0] + normals[1]) / (1 + normals[0] @ normals[1]))


def _sectors(triangle: Array, line: set[tuple[int, int]]) -> tuple[Array, dict[tuple[int, int], int]]:
    """Label the corners (3t,) of all triangles by sectors between creases, and count each edge's triangles.

    A label is one of the sector's own corners.
    """
    sides: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for t, three in enumerate(triangle.tolist()):
        for k in range(3):
            sides.setdefault(_pair(three[k], three[(k + 1) % 3]), []).append((t, k))
    one, two = [], []
    flat = triangle.ravel()
    for pair, owners in sides.items():
        if len(owners) != 2 or pair in line:
            continue
        (t, k), (s, j) = owners
        for a in (3 * t + k, 3 * t + (k + 1) % 3):
            for b in (3 * s + j, 3 * s + (j + 1) % 3):
                if flat[a] == flat[b]:
                    one.append(a)
                    two.append(b)
    joined = label_components(len(flat), np.array(one, int), np.array(two, int))
    _, first, label = np.unique(joined, return_index=True, return_inverse=True)
    return first[label], {pair: len(owners) for pair, owners in sides.items()}
