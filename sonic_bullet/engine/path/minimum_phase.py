"""Impulse response of least phase of a magnitude: what an instrument or a wall does, of which no phase is known.

The causal part of the cepstrum of ln |H|, doubled.             [Oppenheim & Schafer 2010, sec. 13.4]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import complex_exp


def minimum_phase(log_magnitude: Array) -> Array:
    """Return the response (…, 2f - 2) of ln |H| (…, f) at rfft's frequencies; it aliases where it is longer."""
    size = 2 * (log_magnitude.shape[-1] - 1)
    cepstrum = np.fft.irfft(log_magnitude, size)
    cepstrum[..., 1 : size // 2] *= 2
    cepstrum[..., size // 2 + 1 :] = 0
    return np.fft.irfft(complex_exp(np.fft.rfft(cepstrum)), size)
