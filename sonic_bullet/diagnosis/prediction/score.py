"""How far what is played is from what was recorded, over the noise that all recordings of a case share.

D(recorded, played + noise), D of two noisy takes of what is played                       (estimator.distance)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sonic_bullet.diagnosis.prediction.hypothesis import Hypothesis, play
from sonic_bullet.diagnosis.prediction.struck_bodies import Struck
from sonic_bullet.estimator.fit.recorded import RecordedObject as Recorded
from sonic_bullet.estimator.lines.log_spectral import Floor, log_spectral_db, noise_floor_db, with_noise
from sonic_bullet.records import Array


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

    @property
    def place(self) -> tuple[Recorded, int]:
        """Where it is in the evidence: among whose strikes, and which of those. Raises ValueError where it was not fitted."""
        if self.body.recorded is None:
            raise ValueError(f"{self.body.name} was not fitted")
        return self.body.recorded, self.body.fitted.index(self.strike)

    def distance(self, h: Hypothesis) -> float:
        """D in dB of the recording and what the hypothesis plays; NaN where nothing stands above the noise."""
        made = play(h, self.body, self.strike, len(self.sample), self.sr)
        return log_spectral_db(self.sample, with_noise(made, self.floor, self.strike), self.floor)

    def least(self, h: Hypothesis) -> float:
        """D of two noisy takes of what the hypothesis plays."""
        return noise_floor_db(play(h, self.body, self.strike, len(self.sample), self.sr), self.floor)


def mean_db(takes: Sequence[Judged], h: Hypothesis) -> float | None:
    """Mean distance over takes; None where there is none."""
    found = [d for d in (take.distance(h) for take in takes) if np.isfinite(d)]
    return float(np.mean(found)) if found else None


def least_db(takes: Sequence[Judged], h: Hypothesis) -> float | None:
    """Mean noise floor of the distance over takes; None where there is none."""
    found = [d for d in (take.least(h) for take in takes) if np.isfinite(d)]
    return float(np.mean(found)) if found else None
