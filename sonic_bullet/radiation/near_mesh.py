"""Mesh of a body's surface for its near field: as few triangles as its waves ask, from any number of faces.

Faces' corners are gathered by cells of space and side. f faces, c triangles.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.radiation.entrained_mass import PotentialMap, moved_air
from sonic_bullet.radiation.surface_waves import RESOLVED
from sonic_bullet.records import Array

MOST_TRIANGLES = (700, 850, 950, 1200, 1400)
"""Sizes of the near field's mesh, tried until one has a near field: both sides of a wall thinner than the deviation of
its triangles' chords would cross. The last takes 2 s of processor, and some 0.1 s a mode."""

THICKENED = 0.1
"""Of an edge, 1 to 3 mm of what a household has: how far both sides are moved outwards of a wall too thin for any mesh.
A steel plate of 1.5 mm so moved is damped by its sound within 0.7 dB at the median, as between two meshes."""
FINEST_FIRST = 950
"""Triangles with which tries begin at most, whatever the waves; thickened walls begin there, whose two sides nearly
cancel: a steel bowl of 0.8 mm is damped within 1.4 dB of what 1400 have, at the median; of 700 within 3.9."""

DRAFT_TRIANGLES = 300
"""Those of a draft: a tenth of a second."""


def least_triangles(modes: int) -> int:
    """Return the size from which meshes are tried, of `MOST_TRIANGLES`: as bending waves ask, within limits.

    Three edges a wave, as `RESOLVED` has it for sound: m modes of a wall with both sides' area S reach κ = √(8πm/S)
    [Courant & Hilbert 1924, ch. VI.4], an edge is √(4S/√3f).
    """
    wanted = min(32 * np.pi / np.sqrt(3) * modes / RESOLVED**2, FINEST_FIRST)
    return next(most for most in MOST_TRIANGLES if most >= wanted)


def surface_air(corner: Array, area: Array, normal: Array, least: int) -> tuple[PotentialMap, Array] | None:
    """Compute the air moved by the body, and the triangle (f,) of it that represents each face; else None.

    least: of `least_triangles`.
    """
    thickened_least = least if least == DRAFT_TRIANGLES else FINEST_FIRST
    for thickened, fewest in ((0.0, least), (THICKENED, thickened_least)):
        tried = 0
        for most in (DRAFT_TRIANGLES, *MOST_TRIANGLES):
            if most < fewest or (thickened and len(corner) <= most):  # the latter is taken as it is, and was tried
                continue
            coarse, nearest = near_mesh(corner, area, normal, most, thickened)
            moved = moved_air(coarse) if len(coarse) > tried else None
            tried = max(tried, len(coarse))
            if moved is not None:
                return moved, nearest
    return None


def near_mesh(corner: Array, area: Array, normal: Array, most: int, thickened: float = 0.0) -> tuple[Array, Array]:
    """Build triangles (c, 3, 3) for the near field, at most ``most``, and the one (f,) that represents each face.

    thickened: part of an edge by which the surface is moved outwards.
    """
    if len(corner) <= most:
        return corner, np.arange(len(corner))
    from scipy.spatial import cKDTree

    whole = np.round(corner.reshape(-1, 3) / (1e-7 * np.ptp(corner))).astype(np.int64)
    _, first, name = np.unique(_row_numbers(whole), return_index=True, return_inverse=True)
    name = name.reshape(-1, 3)
    point = whole[first] * (1e-7 * np.ptp(corner))
    outward = np.stack(
        [np.bincount(name.ravel(), np.repeat(area * normal[:, i], 3), len(point)) for i in range(3)], axis=1
    )
    edge_m = np.sqrt(4 * area.sum() / most) / 1.5
    while True:
        cell = cells(point, outward, edge_m)
        size = np.bincount(cell)
        middle = np.stack([np.bincount(cell, point[:, i]) / size for i in range(3)], axis=1)
        direction = np.stack([np.bincount(cell, outward[:, i]) for i in range(3)], axis=1)
        direction = direction / np.maximum(np.linalg.norm(direction, axis=1), 1e-300)[:, None]
        reach = np.zeros(len(middle))
        np.maximum.at(reach, cell, ((point - middle[cell]) * direction[cell]).sum(axis=1))
        middle += (reach[:, None] + thickened * edge_m) * direction  # without reach edges are cut off
        triangle = cell[name]
        triangle = triangle[
            (triangle[:, 0] != triangle[:, 1]) & (triangle[:, 1] != triangle[:, 2]) & (triangle[:, 2] != triangle[:, 0])
        ]
        _, first, alike = np.unique(_row_numbers(np.sort(triangle, axis=1)), return_index=True, return_inverse=True)
        odd = (triangle[:, 0] < triangle[:, 1]) ^ (triangle[:, 1] < triangle[:, 2]) ^ (triangle[:, 2] < triangle[:, 0])
        odd_ones = np.bincount(alike.ravel(), odd)
        triangle = triangle[first[(odd_ones == 0) | (odd_ones == np.bincount(alike.ravel()))]]  # folds cancel
        coarse = middle[triangle]
        twice = np.cross(coarse[:, 1] - coarse[:, 0], coarse[:, 2] - coarse[:, 0])
        length = np.linalg.norm(twice, axis=1)
        kept = length > 1e-3 * edge_m**2
        if kept.sum() <= most:
            break
        edge_m *= 1.1
    coarse, facing = coarse[kept], twice[kept] / length[kept, None]
    tree = cKDTree(np.hstack([coarse.mean(axis=1), edge_m * facing]))
    return coarse, tree.query(np.hstack([corner.mean(axis=1), edge_m * normal]))[1]


def cells(point: Array, normal: Array, edge_m: float) -> Array:
    """Assign each point (p,) the number of its cell of edge edge_m and of the side it faces (of six)."""
    cell = np.floor((point - (point.min(axis=0) + point.max(axis=0)) / 2) / edge_m + 0.5).astype(np.int64)
    bias = normal * [1.0, 0.93, 0.87]  # no ties between sides
    axis = np.argmax(np.abs(bias), axis=1)
    side = 2 * axis + (bias[np.arange(len(axis)), axis] > 0)
    return np.unique(_row_numbers(np.column_stack([cell, side])), return_inverse=True)[1].ravel()


def _row_numbers(row: Array) -> Array:
    """Give rows (n, k) of whole numbers a number (n,) each: alike where they are, in their order, quick to sort."""
    row = row - row.min(axis=0)
    made = row[:, 0]
    for column in row.T[1:]:
        width = int(column.max()) + 1
        if int(made.max()) >= 2**62 // width:
            made = np.unique(made, return_inverse=True)[1]
        made = made * width + column
    return made
