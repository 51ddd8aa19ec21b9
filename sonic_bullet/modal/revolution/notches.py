"""Triangles of a section graded towards the corners of its outline that look inward, where stress is singular.

    each pass: a triangle at the corner -> one `NEARER` times as far across, and two behind it

Triangles of one degree then err by hardly more at a corner than elsewhere [Babuška & Suri 1994, sec. 4].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.records import Array


class SectionTriangles(NamedTuple):
    """Triangles of a section.

    Attributes
    ----------
    point, triangle : (n, 2), (t, 3), the outline's points first, in turn
    middle : (s, 2) middles of the outline's sides, one begins at each of its points
    owner : (s,) what each side belongs to
    """

    point: Array
    triangle: Array
    middle: Array
    owner: Array


def grade_triangles(made: SectionTriangles, corner: Array) -> SectionTriangles:
    """Grade triangles towards points of the outline, corner (k,)."""
    point, triangle = [*made.point], [tuple(three) for three in made.triangle.tolist()]
    ring, middle, owner = list(range(len(made.middle))), [*made.middle], made.owner.tolist()
    nearer, passes = 0.5, 6  # frequencies err as h^4μ/2 >= h, μ >= 1/2 [Williams 1952]: by a 64th of what they did
    for one in corner.tolist():
        for _ in range(passes):
            place = ring.index(one)
            before, after = ring[place - 1], ring[(place + 1) % len(ring)]
            cut = {after: _cut_side(point, ring, middle, owner, place, nearer)}
            cut[before] = _cut_side(point, ring, middle, owner, ring.index(before), 1 - nearer)
            near = [three for three in triangle if one in three]
            triangle = [three for three in triangle if one not in three]
            for three in near:
                k = three.index(one)
                b, c = three[(k + 1) % 3], three[(k + 2) % 3]
                for end in (b, c):
                    if end not in cut:
                        cut[end] = len(point)
                        point.append(point[one] + nearer * (point[end] - point[one]))
                triangle += [(one, cut[b], cut[c]), (cut[b], b, c), (cut[b], c, cut[c])]
    inner = np.setdiff1d(np.arange(len(point)), ring)
    order = np.concatenate([ring, inner])
    place_of = np.empty(len(order), np.int64)
    place_of[order] = np.arange(len(order))
    return SectionTriangles(np.array(point)[order], place_of[np.array(triangle)], np.array(middle), np.array(owner))


def _cut_side(point: list[Array], ring: list[int], middle: list[Array], owner: list[int], place: int, at: float) -> int:
    """Cut the side that begins at a place of the ring in two, on its parabola, and return the new point."""
    start, bend, end = point[ring[place]], middle[place], point[ring[(place + 1) % len(ring)]]

    def on(t: float) -> Array:
        return np.asarray(start * (1 - t) * (1 - 2 * t) + 4 * bend * t * (1 - t) + end * t * (2 * t - 1))

    point.append(on(at))
    middle[place : place + 1] = [on(at / 2), on((1 + at) / 2)]
    owner.insert(place, owner[place])
    ring.insert(place + 1, len(point) - 1)
    return len(point) - 1
