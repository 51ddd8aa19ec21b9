"""How far what is played is from what was recorded, over the noise that all recordings of a case share.

D(recorded, played + noise), D of two noisy takes of what is played                       (estimator.distance)
noise: per bin the lower quartile over the last third of every recording, and over neighbouring bins, as nothing stationary is narrow
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sonic_bullet.diagnosis.bodies import Struck
from sonic_bullet.diagnosis.play import Hypothesis, play
from sonic_bullet.estimator.distance import Floor, log_spectral_db, noise_floor_db, with_noise
from sonic_bullet.records import Array

WINDOW = 1024
SIDE = 8  # bins to each side
QUARTILE = float(np.log(4 / 3))  # of an exponential law over its mean


class Judged(Protocol):
    """Something measured that a hypothesis is held against, in dB."""

    def distance(self, h: Hypothesis) -> float:
        """How far the hypothesis is from it; NaN where it says nothing."""
        ...

    def least(self, h: Hypothesis) -> float:
        """How far it would be from itself, measured again."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Take:
    """A recorded strike: which of which body, its samples (n,) from the onset on, and the case's noise."""

    body: Struck
    strike: int
    sample: Array
    sr: int
    floor: Floor

    def distance(self, h: Hypothesis) -> float:
        """D in dB of the recording and what the hypothesis plays; NaN where nothing stands above the noise."""
        made = play(h, self.body, self.strike, len(self.sample), self.sr)
        return log_spectral_db(self.sample, with_noise(made, self.floor, self.strike), self.floor)

    def least(self, h: Hypothesis) -> float:
        """D of two noisy takes of what the hypothesis plays."""
        return noise_floor_db(play(h, self.body, self.strike, len(self.sample), self.sr), self.floor)


def floor_between(signals: list[Array]) -> Floor:
    """The stationary noise of recordings (n,)."""
    rows = []
    shape = np.hanning(WINDOW)
    for signal in signals:
        tail = signal[-max(len(signal) // 3, min(len(signal), 2 * WINDOW)) :]
        if len(tail) < WINDOW:
            tail = np.pad(tail, (0, WINDOW - len(tail)))
        frames = np.lib.stride_tricks.sliding_window_view(tail, WINDOW)[:: WINDOW // 2]
        rows.append(np.abs(np.fft.rfft(frames * shape, axis=1)) ** 2 / (shape**2).sum())
    power = np.concatenate(rows)
    level = np.quantile(power, 0.25, axis=0) / QUARTILE
    side = np.pad(level, SIDE, mode="edge")
    return Floor(np.maximum(np.quantile(np.lib.stride_tricks.sliding_window_view(side, 2 * SIDE + 1), 0.4, axis=1), 1e-24))


def mean_db(takes: Sequence[Judged], h: Hypothesis) -> float | None:
    """Mean distance over takes; None where there is none."""
    found = [d for d in (take.distance(h) for take in takes) if np.isfinite(d)]
    return float(np.mean(found)) if found else None


def least_db(takes: Sequence[Judged], h: Hypothesis) -> float | None:
    """Mean noise floor of the distance over takes; None where there is none."""
    found = [d for d in (take.least(h) for take in takes) if np.isfinite(d)]
    return float(np.mean(found)) if found else None
