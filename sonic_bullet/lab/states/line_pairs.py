"""Which line of one state is which of another: one assignment of all lines at once, held against chance.

    by Cauchy's law of what ln f differs by, with and without one common stretch where that makes far more lines agree,
    and by the likeness of T60 and level                                                        (line_assignment.py)

Most lines of a thing stay where they are, and few go far. The same assignment with the second state's lines at random
places tells how many pairs, and how near ones, chance makes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import Assignment, assign_lines, move_at_random
from sonic_bullet.lab.states.take_lines import SharedLines
from sonic_bullet.records import Array

NEAR = 0.002
"""s: of ln f, within which a line is where it was; takes and temperature move lines of one state by less."""
FARTHEST = 0.5
"""Of ln f: a line that went farther is two lines, one that went and one that came."""


@dataclass(frozen=True, slots=True, eq=False)
class LinePairs:
    """Pairs (p,) of lines by index; chance (p,): expected number of lines as near by chance; the common stretch.

    beyond_chance: whether there are more pairs, and nearer, than random places make.
    """

    before: Array
    after: Array
    chance: Array
    stretch: float
    beyond_chance: bool


def pair_lines(a: SharedLines, b: SharedLines) -> LinePairs:
    """Pair the lines of two states."""
    none = np.zeros(0, int)
    if not len(a.freq_hz) or not len(b.freq_hz):
        return LinePairs(none, none, np.zeros(0), 0.0, False)
    stretch = common_stretch(np.log(a.freq_hz), np.log(b.freq_hz))
    log_hz, random, draws = np.log(b.freq_hz), np.random.default_rng(0), 99
    found = _assign_lines(a, b, stretch, log_hz)
    before, after = found.line, uncross_partners(a.freq_hz[found.line], b.freq_hz, found.mode)
    better = sum(
        _assign_lines(a, b, stretch, move_at_random(log_hz, random)).price <= found.price for _ in range(draws)
    )
    return LinePairs(
        before, after, _expected_by_chance(a, b, before, after, stretch), stretch, 100 * better <= draws + 1
    )


def uncross_partners(before_hz: Array, freq_hz: Array, after: Array) -> Array:
    """Return partners (p,) by index of lines at frequencies (p,), in their own order where near ones move together.

    Cauchy's law would rather send one line far and leave its neighbour than move both by the same.
    """
    together = 0.03  # of ln f between lines that move as one: a split pair's
    after = after.copy()
    moved = np.abs(np.log(freq_hz[after] / before_hz)) > NEAR
    order = np.argsort(before_hz)
    order = order[moved[order]]
    groups = np.split(order, np.flatnonzero(np.diff(np.log(before_hz[order])) > together) + 1) if len(order) else []
    for group in groups:
        after[group] = after[group][np.argsort(freq_hz[after[group]])]
    return after


def common_stretch(a: Array, b: Array) -> float:
    """Return the shift of ln f (k,), (m,) that makes most lines agree; 0 unless it makes far more agree than none."""
    least, fewest = 1.5, 4  # times as many as without it, and as many as any other shift by chance makes
    width = 2 * NEAR
    shifts = np.arange(-FARTHEST, FARTHEST, width / 2)

    def agreeing(shift: float) -> float:
        away = np.abs(b[None] - a[:, None] - shift)
        return (
            float(
                (np.exp(-0.5 * (away.min(axis=1) / width) ** 2)).sum()
                + (np.exp(-0.5 * (away.min(axis=0) / width) ** 2)).sum()
            )
            / 2
        )

    score = np.array([agreeing(shift) for shift in shifts])
    best = int(score.argmax())
    still = agreeing(0.0)
    apart = np.abs(shifts - shifts[best]) > 6 * width
    by_chance = float(score[apart & (np.abs(shifts) > 6 * width)].max(initial=0.0))
    if abs(shifts[best]) <= width or score[best] < max(fewest, least * still, least * by_chance):
        return 0.0
    near = np.abs(b[None] - a[:, None] - shifts[best])
    row = near.argmin(axis=1)
    close = near.min(axis=1) < 2 * width
    return float(np.median(b[row[close]] - a[close]))


def _assign_lines(a: SharedLines, b: SharedLines, stretch: float, log_hz: Array) -> Assignment:
    """Pair the lines of two states, the second's at ln f (m,)."""
    decay_wide, level_wide_db = 0.8, 12.0
    decay = np.log(b.decay_per_s)[None] - np.log(a.decay_per_s)[:, None]
    decay = decay - np.median(decay) * (np.abs(np.median(decay)) > decay_wide)
    level = b.level_db[None] - a.level_db[:, None]
    level = level - (b.level_db.max() - a.level_db.max())
    shift = (0.0, -stretch) if stretch else (0.0,)
    likeness = likeness_of(decay / decay_wide, level / level_wide_db)
    return assign_lines(
        np.log(a.freq_hz), log_hz, NEAR, shift=shift, farthest=FARTHEST, likeness=likeness, pattern_price=0.5
    )


def likeness_of(decay: Array, level: Array) -> Array:
    """Compute how alike lines (k, m) are whose ln d and levels differ by so many spreads: 1, 0 from 2.4 in both."""
    most = 6.0
    return np.asarray(1 - (np.minimum(decay**2, most) + np.minimum(level**2, most)) / (2 * most))


def _expected_by_chance(a: SharedLines, b: SharedLines, before: Array, after: Array, stretch: float) -> Array:
    """Count the lines (p,) expected as near by chance: their density about each times twice the distance.

    Only lines that do not stay count, and that are as strong within `level_wide`.
    """
    level_wide_db, octave = 20.0, np.log(2)
    shift = np.log(b.freq_hz)[after] - np.log(a.freq_hz)[before]
    away = np.minimum(np.abs(shift), np.abs(shift - stretch))
    stays = after[away < NEAR]
    free = np.setdiff1d(np.arange(len(b.freq_hz)), stays)
    found = np.zeros(len(before))
    for p, (i, j) in enumerate(zip(before, after, strict=True)):
        if away[p] < NEAR:
            continue
        near = free[np.abs(np.log(b.freq_hz[free] / a.freq_hz[i])) < octave]
        alike = near[np.abs(b.level_db[near] - b.level_db[j]) < level_wide_db]
        found[p] = len(alike) / (2 * octave) * 2 * away[p]
    return found
