"""The gain by which a sound is nearest to a recording, where nobody says how hard was struck.

    ĝ = argmin over g ≥ 0 of D(r, g·p + noise)              D: signal/log_spectral.py, from powers
        noise: N to a sound that has none, (1 − g²)₊ N to one that was recorded with as much

Which cells stand above the noise goes with g, so D has several minima: all of a grid from nothing upwards are looked
at and the lowest few refined by a part of the cells, and compared by all of them. g = 0 is silence, so no best gain is
farther.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

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
TINY = 1e-3  # of the noise, as in `spectra_distance_db`


class Cells(NamedTuple):
    """Some cells (c,) of a window, their powers over the noise's.

    log_recorded: ln of the recording's with `TINY`. weight: how many cells each stands for. added: whether the sound
    gets the noise in full.
    """

    recorded: Array
    log_recorded: Array
    made: Array
    weight: Array
    added: bool


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
    return _refine_gain(power, made, floor, _search_gains(power, made, floor, recorded), recorded)


def find_nearest_take(power: tuple[Array, ...], takes: list[tuple[Array, ...]], floor: Floor) -> float:
    """Distance in dB of the nearest of other takes at its best gain, by power spectra; NaN where there is none.

    All are searched by some cells, the `REFINED_MINIMA` nearest by all.
    """
    searched = [_search_gains(power, take, floor, True) for take in takes]
    order = np.argsort([costs.min(initial=np.inf) for _, costs, _ in searched], kind="stable")[:REFINED_MINIMA]
    found = [_refine_gain(power, takes[k], floor, searched[k], True).distance_db for k in order]
    return float(np.nanmin(found)) if np.isfinite(found).any() else float("nan")


def _search_gains(
    power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, recorded: bool
) -> tuple[Array, Array, list[Cells]]:
    """Gains (g,) of the grid, D (g,) there by some cells, and these."""
    grid = _grid(power, made, floor)
    few = _few_cells(power, made, floor, added=not recorded) if len(grid) else []
    return grid, np.nan_to_num(np.array([_distance_of_few(few, g) for g in grid]), nan=np.inf, posinf=np.inf), few


def _refine_gain(
    power: tuple[Array, ...],
    made: tuple[Array, ...],
    floor: Floor,
    searched: tuple[Array, Array, list[Cells]],
    recorded: bool,
) -> BestGain:
    """Return the best gain about the lowest minima of a search, by all cells."""
    nearer_db = 0.05  # Than silence: what is printed as the same is the same
    grid, costs, few = searched
    silence = BestGain(0.0, distance_at(power, made, floor, 0.0))
    padded = np.concatenate([[np.inf], costs, [np.inf]])
    minima = np.flatnonzero((costs <= padded[:-2]) & (costs < padded[2:]))
    found: list[BestGain] = []

    def cost(db: float) -> float:
        return float(np.nan_to_num(_distance_of_few(few, 10 ** (db / 20)), nan=np.inf))

    for at in minima[np.argsort(costs[minima], kind="stable")][:REFINED_MINIMA]:
        level = 20 * np.log10(grid[at])
        near = (level - GAIN_REACH_DB, level + GAIN_REACH_DB)
        best = minimize_scalar(cost, bounds=near, method="bounded", options={"xatol": 0.05})
        gain = float(10 ** (best.x / 20))
        distance_db = distance_at(power, made, floor, gain, recorded=recorded)
        found += [BestGain(gain, distance_db)] if np.isfinite(distance_db) else []
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


def _few_cells(power: tuple[Array, ...], made: tuple[Array, ...], floor: Floor, *, added: bool) -> list[Cells]:
    """Draw some cells of every window, those that count at any gain apart from those that may not."""
    grid_cells = 6000  # of a window and of a kind that the grid is searched by, at most: D to some 0.1 dB
    found = []
    for p, m, cell in zip(power, made, noise_spectra(floor, power), strict=False):
        count = min(len(p), len(m))
        inside = np.flatnonzero(cell[0] < HIDING_VARIANCE)
        ours, theirs = ((x[:count, inside] / cell[:, inside]).ravel() for x in (p, m))
        always = ours > 2 * ABOVE_NOISE
        later = np.flatnonzero(~always & (theirs > 0))
        if len(later) > grid_cells:  # those that come to count first, whole
            order = np.argpartition(-theirs[later], grid_cells)
            later, rest = later[order[:grid_cells]], later[np.sort(order[grid_cells:])]
        else:
            rest = later[:0]
        parts = []
        for which in (np.flatnonzero(always), later, rest):
            some = which[np.linspace(0, len(which) - 1, min(grid_cells, len(which))).round().astype(int)]
            parts.append((some, np.full(len(some), len(which) / max(len(some), 1))))
        some, weight = (np.concatenate(x) for x in zip(*parts, strict=True))
        ours, theirs = ours[some].astype(np.float32), theirs[some].astype(np.float32)
        found.append(Cells(ours, np.log(ours + np.float32(TINY)), theirs, weight.astype(np.float32), added))
    return found


def _distance_of_few(few: list[Cells], gain: float) -> float:
    """D by some cells of every window at a gain; NaN where none stands above the noise."""
    row, count = np.zeros((2, len(few)))
    for w, cells in enumerate(few):
        played = np.float32(gain**2) * cells.made + np.float32(1.0 if cells.added else max(0.0, 1 - gain**2))
        weight = cells.weight * (cells.recorded + played > 2 * ABOVE_NOISE)
        off = cells.log_recorded - np.log(played + np.float32(TINY))
        count[w] = weight.sum(dtype=float)
        row[w] = 10 / np.log(10) * np.sqrt(float((weight * off) @ off) / max(count[w], 1e-300))
    use = count >= FEWEST_CELLS if (count >= FEWEST_CELLS).any() else count > 0
    return float(row[use].mean()) if use.any() else np.nan
