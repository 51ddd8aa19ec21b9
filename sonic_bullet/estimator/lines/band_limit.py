"""A recording in the band that was asked for, so that onset, hits, noise and lines are all of it.

The filter is a real, even factor on the spectrum: it delays nothing, and passes the band as it is. What it takes of a
mode's beginning the modes give back once they are found: x_band + (m − m_band), see `restored`.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array

FALL = (0.85, 1.1)  # of the lower edge, of the upper: where the filter is silent
PERIODS = 8.0  # of the lower edge that a recording is continued by at its ends, where it is longer


def limit_band(signal: Array, sr: int, band_hz: tuple[float, float]) -> Array:
    """Keep what a recording holds in a band.

    Parameters
    ----------
    signal : (n,) array
        Samples.
    sr : int
        Their rate in Hz.
    band_hz : (float, float)
        Lowest and highest frequency that pass whole, in Hz.

    Returns
    -------
    (n,) array
        The filtered samples, at the same times.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    low, high = band_hz
    reach = max(0, min(len(signal) - 1, round(PERIODS / max(low, 1.0) * sr)))
    # turned about its ends, as filtfilt does: a hum that is cut off there would else begin with a click
    ends = 2 * signal[:1] - signal[reach:0:-1], 2 * signal[-1:] - signal[-2 : -reach - 2 : -1]
    whole = np.concatenate([ends[0], signal, ends[1]])
    size = next_fast_len(2 * len(whole))
    freq = np.arange(size // 2 + 1) * sr / size
    gain = _raised(freq, FALL[0] * low, low)
    if high * FALL[1] < sr / 2:
        gain *= 1 - _raised(freq, high, FALL[1] * high)
    return np.asarray(irfft(rfft(whole, size) * gain, size)[reach : reach + len(signal)])


def restored(limited: Array, model: Array, sr: int, band_hz: tuple[float, float]) -> Array:
    """A limited recording (n,) with what the limit took of a model (n,) of it."""
    return limited + model - limit_band(model, sr, band_hz)


def _raised(freq: Array, start: float, stop: float) -> Array:
    """Raised cosine (n,) from 0 at start to 1 at stop."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip((freq - start) / max(stop - start, 1e-9), 0, 1))
