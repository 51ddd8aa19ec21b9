"""Noise of a session: what stands before the onsets of its takes and still in their tails.

    N(f) = min(median_i P_i(f) before the onsets, median_i P_i(f) in the last thirds)

A room whirrs and rumbles: its noise has narrow tones, which what is said of one take alone (`floor_between`)
takes for sound. What stands in both stretches of most takes came from no strike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor
from sonic_bullet.signal.short_time import filter_circular, short_time_power, window_energy

WINDOWS = (8192, 4096, 2048, 1024)
GUARD_S = 0.005  # before an onset, whose first sample is not known that well


def session_floor(signals: Sequence[Array], sr: int, starts: Sequence[int]) -> Floor | None:
    """Measure the noise that takes of one session share.

    Parameters
    ----------
    signals : sequence of (n,) arrays
        Samples of each take, less its hum.
    sr : int
        Their rate in Hz.
    starts : sequence of int
        Sample of each onset.

    Returns
    -------
    Floor or None
        None where no take has a window's length before its onset.
    """
    quiet = [signal[: max(0, start - round(GUARD_S * sr))] for signal, start in zip(signals, starts, strict=True)]
    window = next((w for w in WINDOWS if 2 * sum(len(x) >= w for x in quiet) >= len(quiet)), 0)
    tails = [signal[-len(signal) // 3 :] for signal in signals]
    before, after = (_middle(parts, window) for parts in (quiet, tails))
    return None if before is None or after is None else Floor(np.maximum(np.minimum(before, after), 1e-24))


def _middle(parts: Sequence[Array], window: int) -> Array | None:
    """Compute the median over stretches of their mean variance (b,), as `Floor` has it; None where all are short."""
    rows = [
        short_time_power(x - x.mean(), window, window // 4).mean(axis=0) / window_energy(window)
        for x in parts
        if window and len(x) >= window
    ]
    return np.median(rows, axis=0) if rows else None


def without_loud_noise(signal: Array, floor: Floor) -> Array:
    """Filter a take (n,) so that its noise is nowhere louder than at its middle frequency: what is left of it is white.

    By the filter of least phase, which is causal, so that nothing sounds before its onset: its logarithm's cepstrum has
    no part before 0 [Oppenheim & Schafer 2010, sec. 13.5].
    """
    count = len(signal)
    size = 2 * count  # zeros after it, or what a take that still sounds at its end adds comes round to its start
    level = floor.at(count + 1)
    cepstrum = np.fft.irfft(np.log(np.minimum(np.median(level) / level, 1.0)) / 2, size)
    cepstrum[1:count] *= 2
    cepstrum[count + 1 :] = 0
    return filter_circular(signal, np.exp(np.fft.rfft(cepstrum)), size)[:count]


def tone_power(floor: Floor, freq_hz: Array, sr: int) -> Array:
    """Compute the squared amplitude (k,) of tones that would lift the noise at these frequencies to its level."""
    window = np.hanning(2 * (len(floor.variance) - 1))
    return np.asarray(4 * floor.density(freq_hz, sr) * (window**2).sum() / window.sum() ** 2)
