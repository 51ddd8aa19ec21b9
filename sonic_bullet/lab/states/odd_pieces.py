"""Pieces of one kind, good and bad: which of them differs from the rest, and in what.

    takes of each piece -> lines, tracked to the piece whose lines most of the others share -> ln f, ln T60
    shape:   ln f less what size and mass scatter: one common factor of a piece, and what factors the others share
    damping: the median of ln T60 over lines
    z of a piece: its own against the others', whose spread is told without it

Pieces scatter in size and mass, which moves all lines, by one factor or by a few; a notch, a crack or a mass moves
lines each by its own. A piece is named where chance makes any of all as odd in one set of a hundred.
                                                         [leave-one-out residuals: Belsley, Kuh & Welsch 1980, ch. 2]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import Assignment, assign_lines
from sonic_bullet.lab.states.chance import CERTAIN
from sonic_bullet.lab.states.line_pairs import likeness_of
from sonic_bullet.lab.states.recorded_states import RecordedState
from sonic_bullet.lab.states.take_lines import SharedLines, shared_lines
from sonic_bullet.records import Array

FEWEST_PIECES = 6
FACTORS = 3
"""By which size and mass move lines, at most: one of a bar's bending, of bending across and of torsion each."""
DROPPED = 2
"""Of the others, the farthest, by which their scatter is not told."""
ROUNDS = 2
"""In which near lines are exchanged: a second one finds what the first one's exchanges uncover."""
WIDEST = 0.06
"""Of ln f: most that a line of one piece is sought from another's, after the common factor."""


@dataclass(frozen=True, slots=True)
class ComparedPiece:
    """One piece: common factor of its lines in %, its oddest line, T60 over the others', and what is odd.

    verdict: "", "shape" (lines moved each by its own: a notch, a crack, a mass), "damping", or both.
    """

    name: str
    verdict: str
    pitch_percent: float
    oddest_hz: float
    oddest_percent: float
    shape_chance: float
    t60_ratio: float
    damping_chance: float
    lines: int


@dataclass(frozen=True, slots=True)
class Pieces:
    """All pieces of a folder, in its order, and the lines they were held against each other by."""

    pieces: tuple[ComparedPiece, ...]
    line_hz: tuple[float, ...]

    @property
    def odd(self) -> tuple[ComparedPiece, ...]:
        """Return the pieces that differ from the rest."""
        return tuple(one for one in self.pieces if one.verdict)


def find_odd_pieces(states: tuple[RecordedState, ...]) -> Pieces | None:
    """Hold each piece against the rest; None of fewer than `FEWEST_PIECES`, or where they share too few lines."""
    if len(states) < FEWEST_PIECES:
        return None
    found = [shared_lines(state.takes, state.sr) for state in states]
    line_hz, freq, t60 = _common_table(found)
    if len(line_hz) < 4:
        return None
    ring = np.log(t60)
    shape_chance, off, pitch = find_odd_shapes(np.log(freq))
    damping, damping_chance = _odd_decays(ring)
    pieces = []
    for k, state in enumerate(states):
        words = [
            name for name, chance in (("shape", shape_chance[k]), ("damping", damping_chance[k])) if chance <= CERTAIN
        ]
        line = int(np.nanargmax(np.abs(off[k])))
        pieces.append(
            ComparedPiece(
                state.name,
                ", ".join(words),
                float(100 * np.expm1(pitch[k])),
                float(line_hz[line]),
                float(100 * np.expm1(off[k, line])),
                float(shape_chance[k]),
                float(np.exp(damping[k])),
                float(damping_chance[k]),
                int(np.isfinite(freq[k]).sum()),
            )
        )
    return Pieces(tuple(pieces), tuple(float(x) for x in line_hz))


def _common_table(found: list[SharedLines]) -> tuple[Array, Array, Array]:
    """Lines (l,) that nearly all pieces have, and frequencies and T60 (pieces, l) of each."""
    share = 0.75
    best: tuple[Array, Array, Array] = (np.zeros(0), np.zeros((len(found), 0)), np.zeros((len(found), 0)))
    for reference in found:
        freq = np.full((len(found), len(reference.freq_hz)), np.nan)
        t60 = np.full_like(freq, np.nan)
        for k, one in enumerate(found):
            pairs = _partners(reference, one)
            freq[k, pairs.line] = one.freq_hz[pairs.mode]
            t60[k, pairs.line] = np.log(1e3) / one.decay_per_s[pairs.mode]
        kept = np.isfinite(freq).mean(axis=0) >= share
        if kept.sum() > len(best[0]):
            best = reference.freq_hz[kept], freq[:, kept], t60[:, kept]
    order = np.argsort(best[0])
    return best[0][order], best[1][:, order], best[2][:, order]


def _partners(a: SharedLines, b: SharedLines) -> Assignment:
    """Pair the lines of two pieces at the common factor with which most agree."""
    near, level_wide_db, decay_wide = 0.006, 15.0, 1.0
    shift = np.log(b.freq_hz)[None] - np.log(a.freq_hz)[:, None]
    factors = np.arange(-WIDEST, WIDEST + 1e-9, near / 2)
    score = [np.exp(-0.5 * (np.abs(shift - x).min(axis=1) / near) ** 2).sum() for x in factors]
    factor = float(factors[int(np.argmax(score))])
    level = b.level_db[None] - a.level_db[:, None]
    decay = np.log(b.decay_per_s)[None] - np.log(a.decay_per_s)[:, None]
    likeness = likeness_of(decay / decay_wide, level / level_wide_db)
    log_hz = np.log(a.freq_hz), np.log(b.freq_hz)
    return assign_lines(*log_hz, near, shift=(-factor,), farthest=WIDEST, likeness=likeness, pattern_price=0.9)


def find_odd_shapes(log_hz: Array) -> tuple[Array, Array, Array]:
    """Chance (p,) that any piece's lines lie as far off, by how much each line does (p, l), and common factors (p,)."""
    from scipy.stats import f as fisher

    least = 1e-3  # of ln f: what scatter of shape and of takes leaves at least; a notch is to be seen over it
    count, lines = log_hz.shape
    lines_of = _untangle_lines(_fill_missing(log_hz))
    off, chance, pitch = np.full(log_hz.shape, np.nan), np.ones(count), np.zeros(count)
    for k in range(count):
        others = np.delete(lines_of, k, axis=0)
        middle, factor = _scatter_of(others)
        off[k] = np.where(np.isfinite(log_hz[k]), _residual_log_hz(lines_of[k], middle, factor), np.nan)
        pitch[k] = np.median(lines_of[k] - middle)
        left = [_residual_log_hz(row, *_scatter_of(np.delete(others, j, axis=0))) for j, row in enumerate(others)]
        # other odd pieces do not hide this one
        kept = np.array(sorted(left, key=lambda row: float((row**2).sum()))[: len(others) - DROPPED])
        spread = kept.T @ kept / len(kept)
        freedom = max(1.0, float(np.trace(spread) ** 2 / max((spread**2).sum(), 1e-300)))
        variance = np.trace(spread) / lines / _trimmed_mean_ratio(len(others), freedom) + least**2
        far = float(np.nanmean(off[k] ** 2)) / variance
        chance[k] = min(1.0, count * float(fisher.sf(far, freedom, freedom * len(kept))))
    return chance, off, pitch


def _scatter_of(log_hz: Array) -> tuple[Array, Array]:
    """Mean (l,) of pieces' ln f (p, l), and the factors (j, l) that they scatter by.

    Least squares with weights by what the factors leave of each piece, as an odd one among them scatters by its own.
    """
    farthest, rounds = 1.5, 5  # times the median of what is left; beyond it a piece weighs by its inverse square
    weight = np.ones((len(log_hz), 1))
    for _ in range(rounds):
        middle = (weight * log_hz).sum(axis=0) / weight.sum()
        factor = np.linalg.svd(weight * (log_hz - middle), full_matrices=False)[2][:FACTORS]
        left = log_hz - middle - (log_hz - middle) @ factor.T @ factor
        size = np.sqrt((left**2).mean(axis=1, keepdims=True))
        weight = np.minimum(1.0, farthest * np.median(size) / np.maximum(size, 1e-12)) ** 2
    return middle, factor


def _residual_log_hz(log_hz: Array, middle: Array, factor: Array) -> Array:
    """Return what factors (j, l) leave of a piece's ln f (l,)."""
    off = log_hz - middle
    return np.asarray(off - factor.T @ (factor @ off))


def _untangle_lines(log_hz: Array) -> Array:
    """Return ln f (p, l) with near lines in the order in which the others' factors leave least of a piece.

    Lines of two families cross where pieces scatter: which is which, no frequency says by itself.
    """
    made = log_hz.copy()
    for k in range(len(made)):
        middle, factor = _scatter_of(np.delete(made, k, axis=0))
        pairs = [(i, j) for j in range(made.shape[1]) for i in range(j) if abs(middle[i] - middle[j]) < WIDEST]
        least = float((_residual_log_hz(made[k], middle, factor) ** 2).sum())
        for i, j in pairs * ROUNDS:
            other = made[k].copy()
            other[[i, j]] = other[[j, i]]
            size = float((_residual_log_hz(other, middle, factor) ** 2).sum())
            if size < least:
                least, made[k] = size, other
    return made


def _fill_missing(log_hz: Array) -> Array:
    """Return ln f (p, l) with those missing as the factors of pieces that miss none have them, if these do."""
    seen = np.isfinite(log_hz)
    whole = seen.all(axis=1)
    made = np.where(seen, log_hz, np.nanmean(log_hz, axis=0))
    for _ in range(1 if whole.sum() > FACTORS + 1 else 20):
        middle, factor = _scatter_of(made[whole] if whole.sum() > FACTORS + 1 else made)
        for k in np.flatnonzero(~whole):
            off = log_hz[k, seen[k]] - middle[seen[k]]
            share = np.linalg.lstsq(factor[:, seen[k]].T, off, rcond=None)[0]
            made[k] = np.where(seen[k], log_hz[k], middle + share @ factor)
    return made


@cache
def _trimmed_mean_ratio(count: int, freedom: float) -> float:
    """Mean of all but the `DROPPED` largest of so many mean squares, over the mean of all, of a normal law."""
    drawn = np.random.default_rng(0).chisquare(freedom, (4000, count)) / freedom
    return float(np.sort(drawn, axis=1)[:, : count - DROPPED].mean())


def _odd_decays(ring: Array) -> tuple[Array, Array]:
    """Median of ln T60 over lines less the others' (p,), and its chance."""
    off = ring - np.nanmedian(ring, axis=0)
    damping = np.nanmedian(off, axis=1)
    return damping, _chance_of_odd(damping, both=True)


def _chance_of_odd(values: Array, *, both: bool = False) -> Array:
    """Chance (p,) that any of the pieces lies as far from the rest, by Student's law of what is left out in turn.

    The rest are without their two farthest, so that other odd pieces do not hide this one; what is left of a normal
    law's spread then is told from its order statistics, by drawing.
    """
    from scipy.stats import t as student

    least = 0.05  # of a logarithm: T60 and what is left of lines are told no better than to 5 %
    count = len(values)
    drawn = np.random.default_rng(0).standard_normal((4000, count - 1))
    drawn = np.take_along_axis(drawn, np.argsort(np.abs(drawn - np.median(drawn, axis=1, keepdims=True)), axis=1), 1)
    narrow = float(np.mean(drawn[:, : count - 1 - DROPPED].std(axis=1, ddof=1)))
    found = np.ones(count)
    for k in range(count):
        others = np.delete(values, k)
        kept = others[np.argsort(np.abs(others - np.median(others)), kind="stable")][: len(others) - DROPPED]
        spread = max(float(kept.std(ddof=1)) / narrow, least)
        far = (values[k] - float(kept.mean())) / (spread * np.sqrt(1 + 1 / len(kept)))
        tail = student.sf(abs(far) if both else far, len(kept) - 1)
        found[k] = min(1.0, count * (2 if both else 1) * tail)
    return found
