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

import numpy as np

from sonic_bullet.lab.effects.common.line_assignment import Assignment, assign_lines
from sonic_bullet.lab.states.chance import CERTAIN
from sonic_bullet.lab.states.line_pairs import likeness_of
from sonic_bullet.lab.states.recorded_states import RecordedState
from sonic_bullet.lab.states.take_lines import SharedLines, shared_lines
from sonic_bullet.records import Array

FEWEST_PIECES = 6
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
    off, pitch = _without_size(np.log(freq))
    ring = np.log(t60)
    shape_chance, oddest = _odd_shapes(off)
    damping, damping_chance = _odd_decays(ring)
    pieces = []
    for k, state in enumerate(states):
        words = [
            name for name, chance in (("shape", shape_chance[k]), ("damping", damping_chance[k])) if chance <= CERTAIN
        ]
        line = oddest[k]
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


def _without_size(freq: Array) -> tuple[Array, Array]:
    """Return ln f (p, l) less each line's median and each piece's own median factor (p,)."""
    off = freq - np.nanmedian(freq, axis=0)
    pitch = np.nanmedian(off, axis=1)
    off = off - pitch[:, None]
    return off - np.nanmedian(off, axis=0), pitch


def _odd_shapes(off: Array) -> tuple[Array, Array]:
    """Chance (p,) of each piece's lines, and its oddest line (p,).

    Lines of the others are their mean and a few factors (what thickness, width and length move); a piece is held
    against what those factors explain of it, in units of what they leave of each of the others in their turn.
    """
    factors, least = (
        2,
        1e-3,
    )  # of ln f: what scatter of shape and of takes leaves at least; a notch is to be seen over it
    count = len(off)
    size, oddest = np.zeros(count), np.zeros(count, int)
    for k in range(count):
        others = _filled(np.delete(off, k, axis=0), factors)
        # robust: an odd piece among the others is no factor of theirs
        far = np.sqrt((others**2).mean(axis=1))
        weight = np.minimum(1.0, 1.5 * np.median(far) / np.maximum(far, 1e-12)) ** 2
        basis = np.linalg.svd(others * weight[:, None], full_matrices=False)[2][:factors]
        seen = np.isfinite(off[k])
        if seen.sum() <= factors + 1:
            continue
        left = off[k, seen] - basis[:, seen].T @ np.linalg.lstsq(basis[:, seen].T, off[k, seen], rcond=None)[0]
        size[k] = np.sqrt((left**2).sum() / (seen.sum() - factors))
        oddest[k] = int(np.flatnonzero(seen)[np.abs(left).argmax()])
    return _chance_of_odd(np.log(np.hypot(size, least))), oddest


def _filled(off: Array, factors: int) -> Array:
    """Return values (p, l) with those missing as the factors of the rest have them, in a few rounds."""
    seen = np.isfinite(off)
    made = np.where(seen, off, 0.0)
    for _ in range(20 if not seen.all() else 0):
        u, s, v = np.linalg.svd(made, full_matrices=False)
        made = np.where(seen, off, (u[:, :factors] * s[:factors]) @ v[:factors])
    return made


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
    dropped = 2
    count = len(values)
    drawn = np.random.default_rng(0).standard_normal((4000, count - 1))
    drawn = np.take_along_axis(drawn, np.argsort(np.abs(drawn - np.median(drawn, axis=1, keepdims=True)), axis=1), 1)
    narrow = float(np.mean(drawn[:, : count - 1 - dropped].std(axis=1, ddof=1)))
    found = np.ones(count)
    for k in range(count):
        others = np.delete(values, k)
        kept = others[np.argsort(np.abs(others - np.median(others)), kind="stable")][: len(others) - dropped]
        spread = max(float(kept.std(ddof=1)) / narrow, least)
        far = (values[k] - float(kept.mean())) / (spread * np.sqrt(1 + 1 / len(kept)))
        tail = student.sf(abs(far) if both else far, len(kept) - 1)
        found[k] = min(1.0, count * (2 if both else 1) * tail)
    return found
