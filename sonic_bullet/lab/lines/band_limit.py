"""A recording in the band that was asked for, so that onset, hits, noise and lines are all of it.

The filter is a real, even factor on the spectrum: it delays nothing, and passes the band as it is.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.lines.linear_prediction import predicted_on
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import filter_circular, raised_cosine

LOWEST_AUDIBLE_HZ = 20.0  # of what is heard


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
    periods, band_order = 8.0, 64  # of the lower edge that a recording goes on for at its ends; terms that say how
    fall = (0.92, 1.05)  # of the lower edge, of the upper: where the filter is silent
    from scipy.fft import next_fast_len

    low, high = band_hz
    reach = min(len(signal), round(periods / max(low, 1.0) * sr))
    # a hum or a tone goes on, and fades: one that is cut off would begin and end with a click, which is in every band
    fade = raised_cosine((reach - np.arange(reach)) / reach)
    ends = [predicted_on(part, band_order, reach) * fade for part in (signal[reach - 1 :: -1], signal[-reach:])]
    whole = np.concatenate([ends[0][::-1], signal, ends[1]])
    size = next_fast_len(2 * len(whole))
    freq = np.arange(size // 2 + 1) * sr / size
    gain = raised_cosine((freq - fall[0] * low) / (low - fall[0] * low))
    if high * fall[1] < sr / 2:
        gain *= 1 - raised_cosine((freq - high) / (fall[1] * high - high))
    return filter_circular(whole, gain, size)[reach : reach + len(signal)]


def without_drift(signal: Array, sr: int) -> tuple[Array, str]:
    """Take a drift off a recording, which would hide its onset and its noise.

    Parameters
    ----------
    signal : (n,) array
        Samples.
    sr : int
        Their rate in Hz.

    Returns
    -------
    (n,) array
        What lies above 20 Hz; the recording itself where nothing drifts.
    str
        What to say of it, or nothing.
    """
    drifts = 3.16  # times the rms of all that is heard, most of the time: wind, a warming amplifier
    edge = np.arange(0, len(signal), max(round(sr / LOWEST_AUDIBLE_HZ / 2), 1))
    mean = np.add.reduceat(signal, edge) / np.diff(edge, append=len(signal))  # a drift's samples over half a period
    power = np.add.reduceat(signal**2, edge) / np.diff(edge, append=len(signal))
    if not np.median(mean**2 - drifts**2 * (power - mean**2)) > 0:
        return signal, ""
    above = limit_band(signal, sr, (LOWEST_AUDIBLE_HZ, np.inf))
    return above, f"a drift below {LOWEST_AUDIBLE_HZ:.0f} Hz, louder than all above it, is taken off"
