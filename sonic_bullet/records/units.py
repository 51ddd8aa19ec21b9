"""Constants and conversions, SI throughout; the unit is in every name."""

from __future__ import annotations

from sonic_bullet._engine import power

MAINS_HZ = (50.0, 60.0)
REFERENCE_PRESSURE_PA = 20e-6
HEARING_LIMIT_HZ = 20_000.0


def amplitude(level_db: float) -> float:
    """Convert a level in dB to an amplitude ratio."""
    return power(10.0, level_db / 20.0)
