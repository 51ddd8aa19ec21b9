"""Surface of a body of revolution and its displacements there: rows along the outline, times angles.

Rows are the ends and the middles of parabolas, five to the shortest wave along the outline, `AROUND_WAVE` to a
wave around; each turns `BENT` at most. So a model holds about (2 · 5 · outline/λ) x (2 · AROUND_WAVE · m)
points of 12 bytes a mode.
A row on the axis is one point, with triangles about it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonic_bullet.modal.meshing.solid import QUARTERS
from sonic_bullet.modal.revolution.rings import turns
from sonic_bullet.modal.revolution.section import BENT, Section, spread_places
from sonic_bullet.records import Array

AROUND_WAVE = 5  # parabolas around to a wave
AROUND_CELLS = (24, 96)  # parabolas around, least and most


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Circles of the surface.

    Attributes
    ----------
    side, at : (k,) place on a side of the outline
    start : (k,) first of the rows between two poles that each is among
    flat_m : (k, 2) r and z
    curvature : (k,) mean of the principal ones
    closed : whether none lies on the axis
    """

    side: Array
    at: Array
    start: Array
    flat_m: Array
    curvature: Array
    closed: bool


def rows(section: Section, wave: float) -> Rows:
    """Place circles that follow waves of length ``wave`` along the outline."""
    s = len(section.dof)
    turn, on = np.abs(turns(section.rim_m[:, 0])), section.on_axis
    poles = np.flatnonzero(~on & np.roll(on, 1))
    walk = (np.append(poles, np.argmax(turn))[0] + np.arange(s)) % s
    turn, on, ends = turn[walk], on[walk], section.rim_m[walk]
    length = np.linalg.norm(np.diff(ends, axis=1), axis=2).sum(axis=1)
    sharp = (turn >= BENT) | on | np.roll(on, 1)
    sharp[0] = True
    smooth = np.where(sharp, 0, turn)
    per_wave = 5.0  # parabolas to the shortest wave along the outline
    density = np.maximum(per_wave / wave, (smooth + np.roll(smooth, -1)) / 2 / length / BENT)
    side: list[Array] = []
    at: list[Array] = []
    start: list[Array] = []
    here = 0
    for a, b in pairwise(np.append(np.flatnonzero(sharp), s)):
        if on[a]:
            here = sum(len(x) for x in side)
            continue
        end = spread_places(0.0, length[a:b], density[a:b])
        place = np.stack([end[:-1], (end[:-1] + end[1:]) / 2], axis=1).ravel()
        place = np.append(place, end[-1]) if on[b % s] else place
        passed = np.concatenate([[0], np.cumsum(length[a:b])])
        k = np.clip(np.searchsorted(passed, place * (1 + 1e-12), side="right") - 1, 0, b - a - 1)
        side.append(a + k)
        at.append(np.clip((place - passed[k]) / length[a + k], 0, 1))
        start.append(np.full(len(place), here))
    where, x = np.concatenate(side), np.concatenate(at)
    flat = np.einsum("jk,kjx->kx", np.stack([(1 - x) * (1 - 2 * x), 4 * x * (1 - x), x * (2 * x - 1)]), ends[where])
    along = np.einsum("jk,kjx->kx", np.stack([4 * x - 3, 4 - 8 * x, 4 * x - 1]), ends[where])
    bulge = section.curvature[walk][where]
    pole = flat[:, 0] < 1e-9 * length.sum()
    flat[pole, 0] = 0
    around = np.where(pole, bulge, along[:, 1] / np.linalg.norm(along, axis=1) / np.where(pole, 1, flat[:, 0]))
    mean = (bulge + around) / 2
    mean[np.abs(mean) < 1e-9] = 0  # rounding on flat sides
    return Rows(walk[where], x, np.concatenate(start), flat, mean, not on.any())


def surface(circles: Rows, cells: int) -> tuple[Array, Array, Array, Array]:
    """Triangulate the surface with ``cells`` parabolas round it.

    Returns points (v, 3); triangles (f, 3), quarters of quadratic ones, outward; their curvature (f,); and grid (v,),
    the index of each point among the circles' points times angles.
    """
    k, a = len(circles.flat_m), 2 * cells
    pole = circles.flat_m[:, 0] == 0
    length = np.bincount(circles.start, minlength=k)
    own = np.arange(k) - circles.start
    row = np.flatnonzero((own % 2 == 0) & ((own < length[circles.start] - 1) | circles.closed))
    i, j = (g.ravel() for g in np.meshgrid(row, np.arange(0, a, 2), indexing="ij"))

    def at(di: int, dj: int) -> Array:
        there = (i + di) % k if circles.closed else i + di
        return np.asarray(there * a + np.where(pole[there], 0, (j + dj) % a))

    low, high = pole[i], pole[(i + 2) % k]
    first = np.stack([at(0, 0), at(0, 2), at(2, 2), at(0, 1), at(1, 2), np.where(high, at(1, 0), at(1, 1))], axis=1)
    second = np.stack([at(0, 0), at(2, 2), at(2, 0), np.where(low, at(1, 2), at(1, 1)), at(2, 1), at(1, 0)], axis=1)
    six = np.stack([first, second], axis=1)[np.stack([~low, ~high], axis=1)]
    grid, face = np.unique(six[:, QUARTERS].reshape(-1, 3), return_inverse=True)
    middle = np.stack([(i + 1) % k] * 2, axis=1)[np.stack([~low, ~high], axis=1)]
    angle = angles(cells)[grid % a]
    r, z = circles.flat_m[grid // a].T
    point = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    return point, face.reshape(-1, 3).astype(np.int32), np.repeat(circles.curvature[middle], 4), grid


def angles(cells: int) -> Array:
    """Return the angles (2·cells,) in rad about the axis at which the surface has its points."""
    return np.arange(2 * cells) * np.pi / cells


def displacements(section: Section, circles: Rows, vector: Array, m: int, cells: int) -> Array:
    """Compute displacements (1 or 2, k·2·cells, 3, b) of vectors (n, 3, b), and of their partners where m > 0.

    They are on the circles at all angles; ∫|u|² over the body is one where vᵀMv is.
    """
    x = circles.at
    cubic = np.stack([(1 - x) * (1 - 3 * x) * (2 - 3 * x), 9 * x * (1 - x) * (2 - 3 * x)]) / 2
    weight = np.concatenate([cubic, np.stack([9 * x * (1 - x) * (3 * x - 1), x * (3 * x - 1) * (3 * x - 2)]) / 2])
    u, v, w = np.einsum("jk,kjcb->ckb", weight, vector[section.dof[circles.side]])[:, :, None] / np.sqrt(
        2 * np.pi if m == 0 else np.pi
    )
    angle = angles(cells)[:, None]
    made = []
    for turned in (m * angle, m * angle - np.pi / 2)[: 1 if m == 0 else 2]:
        even, odd = np.cos(turned), np.sin(turned) if m else np.ones_like(angle)
        out, around = u * even, v * odd
        moved = [out * np.cos(angle) - around * np.sin(angle), out * np.sin(angle) + around * np.cos(angle), w * even]
        made.append(np.stack(moved, axis=2).reshape(-1, 3, vector.shape[-1]))
    return np.stack(made).astype(np.float32)
