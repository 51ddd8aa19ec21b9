"""Constants and conversions, SI throughout; the unit is in every name."""

from __future__ import annotations

import math

AIR_DENSITY_KG_M3 = 1.2
AIR_SOUND_SPEED_M_S = 343.0
MAINS_HZ = (50.0, 60.0)
REFERENCE_PRESSURE_PA = 20e-6
HEARING_LIMIT_HZ = 20_000.0


def decibel(ratio: float) -> float:
    """Convert an amplitude ratio to a level in dB; ``-inf`` for zero."""
    return 20.0 * math.log10(ratio) if ratio > 0 else -math.inf


def amplitude(level_db: float) -> float:
    """Convert a level in dB to an amplitude ratio."""
    return float(10.0 ** (level_db / 20.0))
