"""Distance of a hypothesis' modes from a list of measured frequencies and decays in place of recordings.

    D = 20 lg(1 + rms min(|ln f_k/f_j|, CAP)/MESH), its mean with 8.7 rms |ln d_k/d_j| where decays are known
        in dB

Lines and modes are paired at the least price. Every fourth line is left out in turn: what was learnt of the others must
hold for it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sonic_bullet.lab.diagnosis.prediction.hypothesis import Hypothesis
from sonic_bullet.lab.diagnosis.prediction.prediction import Prediction
from sonic_bullet.lab.diagnosis.prediction.struck_bodies import StruckBody
from sonic_bullet.lab.effects.common.line_assignment import BEYOND_WIDTHS, assign_lines
from sonic_bullet.lab.lines.line_values import lines_at
from sonic_bullet.records import Array

CAP = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class LineObservation:
    """Some lines (k,) of a body, by index, to be compared with a hypothesis; the others are for learning."""

    folds: ClassVar[int] = 4

    body: StruckBody
    line: Array

    @property
    def name(self) -> str:
        """Name the list."""
        return f"the list of lines of {self.body.name}"

    @property
    def weight(self) -> float:
        """Return 1: of lists there is one, or they are alike."""
        return 1.0

    def hindrance(self, p: Prediction) -> str:
        """Return the reason why they have no distance from a prediction; empty where they have one."""
        assert self.body.recorded is not None
        count = len(self.body.recorded.lines.freq_hz)
        least = 2 * self.folds
        return "" if count >= least else f"holds {count}, and {least} are needed to leave some out in turn"

    def distance(self, p: Prediction) -> float:
        """Compute D in dB."""
        assert self.body.recorded is not None
        lines = self.body.recorded.lines
        return distance_db(*off_by(p, lines.freq_hz[self.line], lines.decay_per_s[self.line]))

    def least(self, p: Prediction) -> float:
        """Compute D of the lines' own spreads."""
        assert self.body.recorded is not None
        lines = self.body.recorded.lines
        sd, decay = np.nan_to_num(lines.freq_sd_hz[self.line]) / lines.freq_hz[self.line], lines.decay_per_s[self.line]
        return distance_db(
            sd,
            np.where(
                np.isfinite(decay), np.nan_to_num(lines.decay_sd_per_s[self.line]) / np.maximum(decay, 1e-9), np.nan
            ),
        )

    def rest(self, bodies: tuple[StruckBody, ...], h: Hypothesis) -> tuple[tuple[StruckBody, ...], Hypothesis]:
        """Remove these lines from the bodies, and what the hypothesis learnt of them."""
        mine = _remove_lines(self.body, self.line)
        correction = dict(h.correction or {})
        old = correction.get(self.body.name)
        if old is not None and len(old) == len(mine.line):
            correction[self.body.name] = np.where(mine.line >= 0, old, 0.0)
        return tuple(mine if b is self.body else b for b in bodies), replace(h, correction=correction)


def list_line_parts(bodies: tuple[StruckBody, ...]) -> tuple[LineObservation, ...]:
    """Divide every body's lines into parts that are left out in turn; too few stay together (`hindrance`)."""
    made = []
    for body in (b for b in bodies if b.recorded is not None):
        count = len(body.recorded.lines.freq_hz) if body.recorded is not None else 0
        folds = LineObservation.folds
        made += [LineObservation(body, np.arange(i, count, folds)) for i in range(folds if count >= 2 * folds else 1)]
    return tuple(made)


def off_by(p: Prediction, freq_hz: Array, decay_per_s: Array) -> tuple[Array, Array]:
    """Compute |ln f/f_j| (k,) of lines and the modes that fit them best, at most CAP, and |ln d/d_j|.

    The latter is NaN where unknown or unpaired.
    """
    line_log_hz, mode_log_hz = np.log(freq_hz), np.log(np.maximum(p.model.freq_hz, 1e-9))
    pairs = assign_lines(line_log_hz, mode_log_hz, CAP / BEYOND_WIDTHS)
    off, lost = np.full(len(freq_hz), CAP), np.full(len(freq_hz), np.nan)
    off[pairs.line] = np.abs(line_log_hz[pairs.line] - mode_log_hz[pairs.mode])
    with np.errstate(divide="ignore", invalid="ignore"):
        lost[pairs.line] = np.abs(np.log(decay_per_s[pairs.line] / p.model.decay_per_s[pairs.mode]))
    return off, np.where(np.isfinite(lost), lost, np.nan)


def distance_db(off: Array, lost: Array) -> float:
    """Compute D of |ln f/f_j| (k,) and |ln d/d_j| (k,)."""
    if not len(off):
        return float("nan")
    mesh = 1e-3  # of a frequency: what a good mesh gets wrong
    found = [20 * np.log10(1 + np.sqrt((off**2).mean()) / mesh)]
    db = 20 / np.log(10)
    if np.isfinite(lost).any():
        found.append(db * np.sqrt(np.nanmean(np.minimum(lost, 3.0) ** 2)))
    return float(np.mean(found))


def _remove_lines(body: StruckBody, line: Array) -> StruckBody:
    """Remove some lines from a body."""
    assert body.recorded is not None
    keep = np.setdiff1d(np.arange(len(body.recorded.lines.freq_hz)), line)
    place = np.full(len(body.recorded.lines.freq_hz) + 1, -1)
    place[keep] = np.arange(len(keep))
    mine = place[body.line]
    return replace(
        body,
        recorded=replace(body.recorded, lines=lines_at(body.recorded.lines, keep)),
        line=mine,
        correction=np.where(mine >= 0, body.correction, 0.0),
    )
