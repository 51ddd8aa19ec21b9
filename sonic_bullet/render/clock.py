"""Physics time and sample time, exactly: step k covers the samples floor(sr·t_k) … floor(sr·t_{k+1}) - 1."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import floor

import numpy as np

from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True)
class Clock:
    """Time at the start of a step, as a fraction of seconds, so that an hour of steps of 1/240 s has no drift."""

    time_s: Fraction = Fraction(0)

    def sample(self, sr: int) -> int:
        """First sample of the step."""
        return floor(self.time_s * sr)

    def after(self, dt_s: float) -> Clock:
        """The clock one step later."""
        return Clock(self.time_s + exact_step(dt_s))

    def progress(self, dt_s: float, sr: int, count: int) -> Array:
        """(count,) where in the step, 0 … 1, each of its samples lies."""
        position = np.arange(count) + float(self.sample(sr) - self.time_s * sr)
        return np.asarray(np.clip(position / (dt_s * sr), 0.0, 1.0))


def exact_step(dt_s: float) -> Fraction:
    """The ratio that a step was meant to be (1/240), where the double is its nearest; else the double itself."""
    near = Fraction(dt_s).limit_denominator(1_000_000)
    return near if float(near) == dt_s else Fraction(dt_s)
