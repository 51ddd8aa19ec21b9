"""Frame rates that texts and times mean."""

from __future__ import annotations

from fractions import Fraction

LONGEST = 20
EXACT = 1e-5
"""By which share a rate that was measured over all of an animation may be off."""


def fraction_of(text: str) -> Fraction:
    """24, 29.97, 30000/1001. Raises ValueError, ZeroDivisionError; powers of ten are none, as ten digits of one would
    take all memory.
    """
    if len(text) > LONGEST or "e" in text.lower():
        raise ValueError(text)
    return Fraction(text)


def nearest_rate(rate: float, within: float = EXACT) -> float:
    """The whole number n, or n·1000/1001 [SMPTE ST 12-1, sec. 4], that a measured rate is by a share of it, else the
    rate.
    """
    usual = [whole * share for share in (1.0, 1000 / 1001) for whole in (round(rate / share),)]
    return min((one for one in usual if abs(rate / one - 1) < within), key=lambda one: abs(rate - one), default=rate)
