"""The gain by which a sound is nearest to a recording, where nobody says how hard was struck.

    ĝ = argmin over g ≥ 0 of D(r, g·p + noise)              D: signal/log_spectral.py, from powers
        noise: N to a sound that has none, (1 − g²)₊ N to one that was recorded with as much

Which cells stand above the noise goes with g, so D has several minima: all of a grid from nothing upwards are looked
at, by a part of the cells, and the lowest few refined by all of them. g = 0 is silence, so no best gain is farther.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import (
    ABOVE_NOISE,
    FEWEST_CELLS,
    HIDING_VARIANCE,
    Floor,
    noise_spectra,
    spectra_distance_db,
)

GAIN_STEP_DB = 1.0
GAIN_REACH_DB = 2.0  # about a minimum, where it is refined
REFINED_MINIMA = 2


@dataclass(frozen=True, slots=True)
class BestGain:
    """A gain and the distance in dB there. 0: no gain makes the sound nearer than silence."""

    gain: float
    distance_db: float


def distance_at(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, gain: float, *, recorded: bool = False
) -> float:
    """D in dB of a recording and a sound at a gain, by power spectra; recorded: the sound has its own noise."""
    noise = noise_spectra(floor, power)
    added = max(0.0, 1 - gain**2) if recorded else 1.0
    counts = [min(len(p), len(m)) for p, m in zip(power, made, strict=False)]
    one = tuple(p[:n] for p, n in zip(power, counts, strict=False))
    other = tuple(gain**2 * m[:n] + added * cell for m, n, cell in zip(made, counts, noise, strict=False))
    return spectra_distance_db(one, other, floor)


def find_best_gain(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, *, recorded: bool = False
) -> BestGain:
    """Find the gain of least distance.

    Parameters
    ----------
    power, made : tuple of (frames, bins) arrays
        Powers of the recording and of the sound under each window.
    floor : Floor
        The recording's noise.
    recorded : bool
        Whether the sound has a noise of its own, as another take has.

    Returns
    -------
    BestGain
        Distance NaN where nothing stands above the noise at any gain.
    """
    return _refined(power, made, floor, _searched(power, made, floor, recorded), recorded)


def find_nearest_take(power: tuple[Array, ...], takes: list[tuple[Array, ...]], floor: Floor) -> float:
    """Distance in dB of the nearest of other takes at its best gain, by power spectra; NaN where there is none.

    All are searched by some cells, the `REFINED_MINIMA` nearest by all.
    """
    searched = [_searched(power, take, floor, True) for take in takes]
    order = np.argsort([costs.min(initial=np.inf) for _, costs in searched], kind="stable")[:REFINED_MINIMA]
    found = [_refined(power, takes[k], floor, searched[k], True).distance_db for k in order]
    return float(np.nanmin(found)) if np.isfinite(found).any() else float("nan")


def _searched(power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, recorded: bool) -> tuple[Array, Array]:
    """Gains (g,) of the grid and D (g,) there, by some cells."""
    grid = _grid(power, made, floor)
    if not len(grid):
        return grid, grid
    few = _few_cells(power, made, floor, added=not recorded)
    return grid, np.nan_to_num(_distances_of_few(few, grid), nan=np.inf, posinf=np.inf)


def _refined(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, searched: tuple[Array, Array], recorded: bool
) -> BestGain:
    """Return the best gain about the lowest minima of a search, by all cells."""
    nearer_db = 0.05  # Than silence: what is printed as the same is the same
    grid, costs = searched
    silence = BestGain(0.0, distance_at(power, made, floor, 0.0))
    padded = np.concatenate([[np.inf], costs, [np.inf]])
    minima = np.flatnonzero((costs <= padded[:-2]) & (costs < padded[2:]))
    found: list[BestGain] = []

    def cost(db: float) -> float:
        return distance_at(power, made, floor, 10 ** (db / 20), recorded=recorded)

    for at in minima[np.argsort(costs[minima], kind="stable")][:REFINED_MINIMA]:
        level = 20 * np.log10(grid[at])
        near = (level - GAIN_REACH_DB, level + GAIN_REACH_DB)
        best = minimize_scalar(cost, bounds=near, method="bounded", options={"xatol": 0.1})
        found += [BestGain(float(10 ** (best.x / 20)), float(best.fun))] if np.isfinite(best.fun) else []
    nearest = min(found, key=lambda one: one.distance_db, default=silence)
    return silence if nearest.distance_db > silence.distance_db - nearer_db else nearest


def _grid(power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor) -> Array:
    """Return gains from where a sound is lost in the noise to where it is over_db louder than the recording.

    None of a sound that is nothing in the band.
    """
    over, level = 0.0, np.zeros(2)
    for p, m, cell in zip(power, made, noise_spectra(floor, power), strict=False):
        over = max(over, float((m / cell).max()))
        inside = cell[0] < HIDING_VARIANCE
        level += np.array([p[:, inside].sum(), m[:, inside].sum()])
    if not (over > 0 and level[1] > 0 and np.isfinite(level).all()):
        return np.zeros(0)
    # the grid begins where the loudest cell is that far below its noise, and ends that far over equal energy
    below_db, over_db = 10.0, 40.0
    top = 10 * np.log10(max(level[0], 1e-300) / level[1]) + over_db
    bottom = min(-10 * np.log10(over) - below_db, top)
    return np.asarray(10 ** (np.arange(bottom, top + GAIN_STEP_DB, GAIN_STEP_DB) / 20))


def _few_cells(power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, *, added: bool) -> list[Array]:
    """Draw some cells (5, c) of every window.

    Powers of recording and sound, the noise, whether the sound gets it in full, how many cells each stands for. Cells
    that count at any gain are drawn apart from those that may not.
    """
    grid_cells = 6000  # of a window and of a kind that the grid is searched by, at most: D to some 0.1 dB
    found = []
    for p, m, cell in zip(power, made, noise_spectra(floor, power), strict=False):
        count = min(len(p), len(m))
        inside = np.flatnonzero(cell[0] < HIDING_VARIANCE)
        noise = np.broadcast_to(cell, p.shape)[:count, inside].ravel()
        ours, theirs = p[:count, inside].ravel(), m[:count, inside].ravel()
        always = ours > 2 * ABOVE_NOISE * noise
        loud = np.argsort(-theirs / noise, kind="stable")  # those that come to count first, whole; evenly from there
        loud = loud[: int((theirs > 0).sum())]
        rows = []
        for which in (np.flatnonzero(always), *np.split(loud[~always[loud]], [grid_cells])):
            some = which[np.linspace(0, len(which) - 1, min(grid_cells, len(which))).round().astype(int)]
            weight = np.full(len(some), len(which) / max(len(some), 1))
            rows.append(np.stack([ours[some], theirs[some], noise[some], np.full(len(some), float(added)), weight]))
        found.append(np.concatenate(rows, axis=1))
    return found


def _distances_of_few(few: list[Array], gain: Array) -> Array:
    """D (g,) by some cells of every window at gains (g,): one after the other, whose cells stay in a core's cache."""
    row, count = np.zeros((2, len(few), len(gain)))
    for w, (ours, theirs, noise, added, weight) in enumerate(few):
        tiny = 1e-3 * noise
        for k, g in enumerate(gain):
            played = g**2 * theirs + np.maximum(added, max(0.0, 1 - g**2)) * noise
            counted = np.flatnonzero((ours + played) / 2 > ABOVE_NOISE * noise)
            ratio = (ours[counted] + tiny[counted]) / (played[counted] + tiny[counted])
            count[w, k] = weight[counted].sum()
            row[w, k] = np.sqrt(weight[counted] @ (10 * np.log10(ratio)) ** 2 / max(count[w, k], 1e-300))
    use = np.where((count >= FEWEST_CELLS).any(axis=0), count >= FEWEST_CELLS, count > 0)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(use.any(axis=0), (use * row).sum(axis=0) / np.maximum(use.sum(axis=0), 1), np.nan))
