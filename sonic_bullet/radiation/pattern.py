"""Directions of a body's modes: the pressure of each towards a point, over its mean over all directions.

    g(r̂) = p(r̂) e^{-ik reach(r̂)} / √<|p|²>,  <|g|²> = 1     weight of far_field -> its size times g

On a grid in the body's frame: PATTERN_ROWS of height, the first and the last the poles, by PATTERN_TURNS; straight
between four of its points, and scaled by mode so that the mean square over directions is 1 of what is between, too.
What is finer than the grid, beams of modes whose body is longer than some two wavelengths, is coarser then, of the same
power.
"""

from __future__ import annotations

import math

import numpy as np

from sonic_bullet.radiation.far_field import SurfaceTerms, spread_directions, surface_pressure, surface_terms
from sonic_bullet.records import Air, Array, ModalModel
from sonic_bullet.signal.elementary import arccos, arctan2

PATTERN_RINGS, PATTERN_TURNS = 24, 48
PATTERN_ROWS = PATTERN_RINGS + 2


def radiation_pattern(model: ModalModel, air: Air) -> Array | None:
    """Compute g (PATTERN_ROWS·PATTERN_TURNS, m) complex on the grid; None for a compact body, by their law.

    A mode that does not radiate has 1 everywhere.
    """
    pattern_modes = 64
    terms = surface_terms(model, air)
    if not isinstance(terms, SurfaceTerms):
        return None
    polar = np.pi * (np.arange(PATTERN_RINGS) + 0.5) / PATTERN_RINGS
    angle = 2 * np.pi * np.arange(PATTERN_TURNS) / PATTERN_TURNS
    level = np.repeat(np.cos(polar)[:, None], PATTERN_TURNS, axis=1)
    across, along = np.outer(np.sin(polar), np.cos(angle)), np.outer(np.sin(polar), np.sin(angle))
    half, m = PATTERN_RINGS // 2, model.mode_count
    upper = np.ascontiguousarray(np.stack([across, along, level], axis=-1)[:half].reshape(-1, 3) @ terms.turn.T)
    grid = np.ones((PATTERN_ROWS, PATTERN_TURNS, m), complex)
    for lo in range(0, m, pattern_modes):
        now = np.arange(lo, min(lo + pattern_modes, m))
        pressure, reach = surface_pressure(terms, air, upper, now)
        left = pressure * np.exp(-1j * terms.k[now, None] * reach)
        ahead, behind = left.T.reshape(2, half, PATTERN_TURNS, len(now))
        grid[1 : half + 1, :, now] = ahead
        grid[half + 1 : -1, :, now] = np.roll(behind[::-1], PATTERN_TURNS // 2, axis=1)  # -r̂: π - θ, φ + π
    grid[0], grid[-1] = grid[1].mean(axis=0), grid[-2].mean(axis=0)
    flat = grid.reshape(PATTERN_ROWS * PATTERN_TURNS, m)
    checked_directions = 512  # Directions, and their negatives, that the mean is taken over
    every = spread_directions(checked_directions)[0]
    mean = (np.abs(interpolate_pattern(flat, np.concatenate([every, -every]))) ** 2).mean(axis=0)
    flat[:, mean == 0] = 1.0
    return np.asarray(flat / np.sqrt(np.where(mean > 0, mean, 1.0)))


def interpolate_pattern(grid: Array, direction: Array) -> Array:
    """Interpolate g (n, m) on a grid (PATTERN_ROWS·PATTERN_TURNS, m) towards directions (n, 3) of the body's frame."""
    length = np.maximum(np.linalg.norm(direction, axis=-1), 1e-300)
    polar = np.arccos(np.clip(direction[:, 2] / length, -1, 1)) * PATTERN_RINGS / np.pi
    around = (np.arctan2(direction[:, 1], direction[:, 0]) * PATTERN_TURNS / (2 * np.pi)) % PATTERN_TURNS
    # rows lie at 0, ½, 1½ … PATTERN_RINGS - ½, PATTERN_RINGS
    row = np.clip(np.floor(polar + 0.5).astype(int), 0, PATTERN_ROWS - 2)
    begin = np.clip(row - 0.5, 0, None)
    down = (polar - begin) / (np.minimum(row + 0.5, PATTERN_RINGS) - begin)
    first = np.floor(around).astype(int) % PATTERN_TURNS
    along, second = around - np.floor(around), (first + 1) % PATTERN_TURNS
    return np.asarray(
        grid[row * PATTERN_TURNS + first] * ((1 - down) * (1 - along))[:, None]
        + grid[row * PATTERN_TURNS + second] * ((1 - down) * along)[:, None]
        + grid[(row + 1) * PATTERN_TURNS + first] * (down * (1 - along))[:, None]
        + grid[(row + 1) * PATTERN_TURNS + second] * (down * along)[:, None]
    )


def toward(grid: Array, direction: Array) -> Array:
    """Compute `interpolate_pattern` (m,) for one unit vector (3,)."""
    x, y, z = direction.tolist()
    polar = float(arccos(min(max(z, -1.0), 1.0))) * PATTERN_RINGS / math.pi
    around = (float(arctan2(y, x)) * PATTERN_TURNS / (2 * math.pi)) % PATTERN_TURNS
    row, first = min(max(math.floor(polar + 0.5), 0), PATTERN_ROWS - 2), math.floor(around) % PATTERN_TURNS
    begin = max(row - 0.5, 0.0)
    down, along = (polar - begin) / (min(row + 0.5, PATTERN_RINGS) - begin), around - math.floor(around)
    at, second = row * PATTERN_TURNS, (first + 1) % PATTERN_TURNS
    upper = (1 - along) * grid[at + first] + along * grid[at + second]
    lower = (1 - along) * grid[at + PATTERN_TURNS + first] + along * grid[at + PATTERN_TURNS + second]
    return np.asarray((1 - down) * upper + down * lower)
