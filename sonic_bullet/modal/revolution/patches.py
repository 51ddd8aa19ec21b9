"""Parts of a surface of revolution triangulated without rings: their vertices lie on one curve of (r, z).

    faces with a vertex in no ring, joined by such vertices -> a patch
    between two rings, between a ring and the axis -> sorted by r, or by z where the patch is steep
        -> one curve: it never turns back, and the faces lie along it

Examples: a bottom with a square of quadrangles in its middle, a wall that a mesher made.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.records import Array

OFF = 0.05  # of the longest edge: how far a face's middle may lie off the curve; facets lie within it
APART = 0.4  # of the median edge: how far points of the curve lie apart


class Patch(NamedTuple):
    """Part of a surface of revolution between two rings, or a ring and the axis.

    Attributes
    ----------
    ends : the rings, -1 for the axis
    curve : (c, 2) points (r, z) between, from the first end on; on the axis the last
    """

    ends: tuple[int, int]
    curve: Array


def patches(point: Array, face: Array, ring: Array, middle: Array) -> list[Patch] | None:
    """Find the patches of a surface about the z axis, None where one is no surface of revolution.

    Parameters
    ----------
    point, face : (v, 3), (f, 3)
    ring : (v,) ring of each vertex, -1 for none
    middle : (k, 2) of the rings
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    loose = ring[face] < 0
    mine = face[loose.any(axis=1)]
    if not len(mine):
        return []
    pair = np.concatenate([mine[:, [0, 1]], mine[:, [1, 2]], mine[:, [2, 0]]])
    pair = pair[(ring[pair] < 0).all(axis=1)]
    n = len(point)
    _, label = connected_components(coo_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(n, n)))
    piece = np.where(ring[mine] < 0, label[mine], -1).max(axis=1)
    found = [_patch(point, mine[piece == p], ring, middle) for p in np.unique(piece)]
    return None if any(patch is None for patch in found) else [patch for patch in found if patch is not None]


def _patch(point: Array, face: Array, ring: Array, middle: Array) -> Patch | None:
    steep = 3.0  # slope against r, or against z, at most
    edge = np.linalg.norm(point[face] - point[np.roll(face, -1, axis=1)], axis=2)
    ends = np.setdiff1d(ring[face], [-1])
    mine = np.unique(face[ring[face] < 0])
    flat = np.stack([np.hypot(point[mine, 0], point[mine, 1]), point[mine, 2]], axis=1)
    if len(ends) == 1 and middle[ends[0], 0] > 0 and flat[:, 0].min() < edge.max():
        tip = np.array([0.0, flat[np.argmin(flat[:, 0]), 1]])
        first, last, to = middle[ends[0]], tip, -1
        flat = flat[flat[:, 0] > APART * np.median(edge)]
    elif len(ends) == 2:
        first, last, to = middle[ends[0]], middle[ends[1]], int(ends[1])
    else:
        return None
    whole = np.concatenate([[first], flat, [last]])
    key = int(np.ptp(whole[:, 1]) > np.ptp(whole[:, 0]))
    heading = np.sign(last[key] - first[key])
    along, across = heading * whole[:, key], whole[:, 1 - key]
    order = np.argsort(along, kind="stable")
    step, rise = np.diff(along[order]), np.abs(np.diff(across[order]))
    least = 1e-4 * float(np.median(edge))
    if order[0] != 0 or order[-1] != len(whole) - 1 or (rise > steep * step + least).any():
        return None
    kept, here = [0], along[0]
    for i in order[1:-1]:
        if min(along[i] - here, along[-1] - along[i]) > APART * np.median(edge):
            kept.append(int(i))
            here = along[i]
    curve = whole[[*kept, len(whole) - 1]]
    centre = point[face].mean(axis=1)
    own = np.stack([np.hypot(centre[:, 0], centre[:, 1]), centre[:, 2]], axis=1)
    off = np.interp(heading * own[:, key], heading * curve[:, key], curve[:, 1 - key]) - own[:, 1 - key]
    if np.abs(off).max() > OFF * edge.max():
        return None
    return Patch((int(ends[0]), to), curve[1:] if to < 0 else curve[1:-1])
