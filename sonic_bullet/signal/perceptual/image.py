"""Loudness of a recording over time and Bark, at several resolutions.

    P[m, k] = |Σ_n w[n] s[n + mH] e^{−iω_k n}|²                                             [Ren, Yeh, Lin 2013, eq. 9]

w is Nuttall's window of four cosines with a continuous first derivative [Nuttall 1981, table II], side lobes below −93
dB. Powers of bins go to triangles every `bark_step` on the Bark axis and each triangle to sone at its middle. Every
level doubles the window.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import RecordError
from sonic_bullet.signal.perceptual.loudness import bark, bark_to_hz, loudness
from sonic_bullet.signal.short_time import short_time_power

OUTSIDE = -2  # in Level.band: a bin that feeds no triangle


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """One resolution: window and hop in samples, and where its bins go. k bins, b bands, m frames."""

    window: int
    hop: int
    band: Array  # (k,) int64: the lower of the two triangles a bin feeds (−1: only the first), or OUTSIDE
    share: Array  # (k,) part that goes to the upper one
    scale: float  # |bin|² times this is mean square
    loud: Array  # (m, b) sone of the recording


def band_middles(bark_step: float) -> Array:
    """Return the middles (b,) in Hz of the bands up to 24 Bark."""
    bark_last = 24.0
    return bark_to_hz(bark_step * np.arange(1, int(bark_last / bark_step) + 1))


def window(length: int) -> Array:
    """(length,) Nuttall's window, periodic."""
    phase = 2 * np.pi * np.arange(length) / length
    image_window = (0.355768, 0.487396, 0.144232, 0.012604)
    a0, a1, a2, a3 = image_window
    return np.asarray(a0 - a1 * np.cos(phase) + a2 * np.cos(2 * phase) - a3 * np.cos(3 * phase))


def _bins(length: int, sr: int, bark_step: float, bands: int) -> tuple[Array, Array]:
    place = bark(np.arange(length // 2 + 1) * sr / length) / bark_step - 1
    below = np.floor(place).astype(np.int64)
    inside = (below >= -1) & (below < bands)
    return np.where(inside, below, OUTSIDE), np.where(inside, place - below, 0.0)


def pool_powers(power: Array, band: Array, share: Array, bands: int) -> Array:
    """(m, k) powers of bins -> (m, bands) of triangles. Bins of one triangle lie next to each other."""
    inside = np.flatnonzero(band != OUTSIDE)
    power, place, share = power[:, inside], band[inside], share[inside]
    first = np.flatnonzero(np.diff(place, prepend=OUTSIDE))
    pooled = np.zeros((len(power), bands + 2))
    pooled[:, place[first] + 1] += np.add.reduceat(power * (1 - share), first, axis=1)
    pooled[:, place[first] + 2] += np.add.reduceat(power * share, first, axis=1)
    return pooled[:, 1:-1]


def loudness_levels(
    signal: Array,
    sr: int,
    onset_s: float,
    full_scale_db_spl: float,
    *,
    bark_step: float = 0.5,
    levels: int = 5,
    shortest_s: float = 0.0107,
    seconds: float = 1.0,
) -> tuple[Level, ...]:
    """Return how loud a recording is over time and Bark, at several resolutions.

    Parameters
    ----------
    signal : (n,) array
        Samples.
    sr : int
        Their rate in Hz.
    onset_s : float
        Where the sound begins, in s.
    full_scale_db_spl : float
        Level in dB SPL that an rms of 1 stands for.
    bark_step : float
        Distance of the bands' middles in Bark.
    levels : int
        Resolutions, as many as fit: each window is twice the last.
    shortest_s : float
        About the shortest window, in s.
    seconds : float
        How much is looked at from the onset on, in s.

    Returns
    -------
    tuple of Level
        The shortest window first.

    Raises
    ------
    RecordError
        Less than one window follows the onset, or nothing there is loud enough.
    """
    first = int(np.ceil(onset_s * sr - 1e-9))
    observed = np.ascontiguousarray(signal[first : first + int(seconds * sr)])
    middle_hz = band_middles(bark_step)
    bands = len(middle_hz)
    shortest = 2 ** round(np.log2(shortest_s * sr))
    if len(observed) < shortest:
        raise RecordError(f"{len(observed)} samples follow the onset at {onset_s:.4f} s", f"an image needs {shortest}")
    made = []
    for step in range(levels):
        length = shortest * 2**step
        if length > len(observed):
            break
        band, share = _bins(length, sr, bark_step, bands)
        scale = 2 / (length * float((window(length) ** 2).sum()))
        power = pool_powers(short_time_power(observed, window(length), length // 2) * scale, band, share, bands)
        made.append(Level(length, length // 2, band, share, scale, loudness(power, middle_hz, full_scale_db_spl)))
    if not any(level.loud.any() for level in made):
        raise RecordError(
            f"nothing is heard at {full_scale_db_spl:g} dB SPL full scale", "raise the level that full scale stands for"
        )
    return tuple(made)
