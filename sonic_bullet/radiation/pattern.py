"""Directions of a body's modes: the pressure of each towards a point, over its mean over all directions.

    g(r̂) = p(r̂) e^{-ik reach(r̂)} / √<|p|²>,  <|g|²> = 1     weight of far_field -> its size times g

On a grid in the body's frame: ROWS of height, the first and the last the poles, by TURNS; straight between four of its
points, and scaled by mode so that the mean square over directions is 1 of what is between, too. What is finer than the
grid, beams of modes whose body is longer than some two wavelengths, is coarser then, of the same power.
"""

from __future__ import annotations

import math

import numpy as np

from sonic_bullet.radiation.far_field import SurfaceTerms, spread_directions, surface_pressure, surface_terms
from sonic_bullet.records import Air, Array, ModalModel

RINGS, TURNS = 24, 48
ROWS = RINGS + 2
CHECKED = 512
"""Directions, and their negatives, that the mean is taken over."""
MODES = 64


def radiation_pattern(model: ModalModel, air: Air) -> Array | None:
    """Compute g (ROWS·TURNS, m) complex on the grid; None for a body that radiates by the law of compact ones.

    A mode that does not radiate has 1 everywhere.
    """
    terms = surface_terms(model, air)
    if not isinstance(terms, SurfaceTerms):
        return None
    polar = np.pi * (np.arange(RINGS) + 0.5) / RINGS
    angle = 2 * np.pi * np.arange(TURNS) / TURNS
    level = np.repeat(np.cos(polar)[:, None], TURNS, axis=1)
    across, along = np.outer(np.sin(polar), np.cos(angle)), np.outer(np.sin(polar), np.sin(angle))
    half, m = RINGS // 2, model.mode_count
    upper = np.ascontiguousarray(np.stack([across, along, level], axis=-1)[:half].reshape(-1, 3) @ terms.turn.T)
    grid = np.ones((ROWS, TURNS, m), complex)
    for lo in range(0, m, MODES):
        now = np.arange(lo, min(lo + MODES, m))
        pressure, reach = surface_pressure(terms, air, upper, now)
        left = pressure * np.exp(-1j * terms.k[now, None] * reach)
        ahead, behind = left.T.reshape(2, half, TURNS, len(now))
        grid[1 : half + 1, :, now] = ahead
        grid[half + 1 : -1, :, now] = np.roll(behind[::-1], TURNS // 2, axis=1)  # -r̂: π - θ, φ + π
    grid[0], grid[-1] = grid[1].mean(axis=0), grid[-2].mean(axis=0)
    flat = grid.reshape(ROWS * TURNS, m)
    every = spread_directions(CHECKED)[0]
    mean = (np.abs(between(flat, np.concatenate([every, -every]))) ** 2).mean(axis=0)
    flat[:, mean == 0] = 1.0
    return np.asarray(flat / np.sqrt(np.where(mean > 0, mean, 1.0)))


def between(grid: Array, direction: Array) -> Array:
    """Interpolate g (n, m) on a grid (ROWS·TURNS, m) towards directions (n, 3) of the body's frame."""
    length = np.maximum(np.linalg.norm(direction, axis=-1), 1e-300)
    polar = np.arccos(np.clip(direction[:, 2] / length, -1, 1)) * RINGS / np.pi
    around = (np.arctan2(direction[:, 1], direction[:, 0]) * TURNS / (2 * np.pi)) % TURNS
    # rows lie at 0, ½, 1½ … RINGS - ½, RINGS
    row = np.clip(np.floor(polar + 0.5).astype(int), 0, ROWS - 2)
    begin = np.clip(row - 0.5, 0, None)
    down = (polar - begin) / (np.minimum(row + 0.5, RINGS) - begin)
    first = np.floor(around).astype(int) % TURNS
    along, second = around - np.floor(around), (first + 1) % TURNS
    return np.asarray(
        grid[row * TURNS + first] * ((1 - down) * (1 - along))[:, None]
        + grid[row * TURNS + second] * ((1 - down) * along)[:, None]
        + grid[(row + 1) * TURNS + first] * (down * (1 - along))[:, None]
        + grid[(row + 1) * TURNS + second] * (down * along)[:, None]
    )


def toward(grid: Array, direction: Array) -> Array:
    """Compute `between` (m,) for one unit vector (3,)."""
    x, y, z = direction.tolist()
    polar = math.acos(min(max(z, -1.0), 1.0)) * RINGS / math.pi
    around = (math.atan2(y, x) * TURNS / (2 * math.pi)) % TURNS
    row, first = min(max(math.floor(polar + 0.5), 0), ROWS - 2), math.floor(around) % TURNS
    begin = max(row - 0.5, 0.0)
    down, along = (polar - begin) / (min(row + 0.5, RINGS) - begin), around - math.floor(around)
    at, second = row * TURNS, (first + 1) % TURNS
    upper = (1 - along) * grid[at + first] + along * grid[at + second]
    lower = (1 - along) * grid[at + TURNS + first] + along * grid[at + TURNS + second]
    return np.asarray((1 - down) * upper + down * lower)
