"""Physics time and sample time, exactly: step k covers the samples floor(sr·t_k) … floor(sr·t_{k+1}) - 1."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from math import lcm
from typing import NamedTuple


class Clock(NamedTuple):
    """Time at the start of a step, ticks/per_second in whole numbers: an hour of steps of 1/240 s has no drift."""

    ticks: int = 0
    per_second: int = 1

    @property
    def time_s(self) -> float:
        """Time in seconds."""
        return self.ticks / self.per_second

    def sample(self, sr: int) -> int:
        """Return the first sample of the step."""
        return self.ticks * sr // self.per_second

    def offset(self, sr: int) -> float:
        """Return the first sample's position relative to the step's start, in samples: 0 or before it."""
        return -(self.ticks * sr % self.per_second) / self.per_second

    def after(self, dt_s: float, count: int = 1) -> Clock:
        """Return the clock so many steps of one length later."""
        step = exact_step(dt_s)
        ticks, per_second = count * step.numerator, step.denominator
        if per_second == self.per_second:
            return Clock(self.ticks + ticks, per_second)
        common = lcm(per_second, self.per_second)
        return Clock(self.ticks * (common // self.per_second) + ticks * (common // per_second), common)


@lru_cache(maxsize=64)
def exact_step(dt_s: float) -> Fraction:
    """Return the ratio that a step was meant to be (1/240), where the double is its nearest; else the double itself."""
    near = Fraction(dt_s).limit_denominator(1_000_000)
    return near if float(near) == dt_s else Fraction(dt_s)
