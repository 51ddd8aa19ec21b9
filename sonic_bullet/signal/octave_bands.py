"""Octave bands of a power spectrum: f/√2 ≤ band < f·√2 about each mid-band frequency f          [IEC 61260-1, 5.5]."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sonic_bullet.records import Array

AUDIBLE_OCTAVES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0)
"""Mid-band frequencies, Hz."""


def in_octave(freq_hz: Array, middle_hz: float) -> Array:
    """Return which frequencies (f,) lie in the octave about ``middle_hz``."""
    edge = 2**0.5
    return np.asarray((freq_hz >= middle_hz / edge) & (freq_hz < middle_hz * edge))


def octave_power(power: Array, freq_hz: Array, middles_hz: Iterable[float]) -> list[Array]:
    """Sum a power (…, f) over each octave: one value (…) for each of ``middles_hz``."""
    return [np.asarray(power[..., in_octave(freq_hz, middle)].sum(axis=-1)) for middle in middles_hz]
