"""Short-time spectra under a Hann window: frames that lie wholly inside a signal.

X[m, k] = Σ_n w[n] x[n + m·hop] e^{−2πikn/N},  w[n] = (1 − cos 2πn/(N−1))/2               [Harris 1978, eq. 27a]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def short_time_spectra(signal: Array, window: int, hop: int) -> Array:
    """Compute the spectra (…, m, window/2 + 1) complex of a signal (…, n); hop: samples between two frames."""
    frames = np.lib.stride_tricks.sliding_window_view(signal, window, axis=-1)[..., ::hop, :]
    return np.asarray(np.fft.rfft(frames * np.hanning(window), axis=-1))


def short_time_power(signal: Array, window: int, hop: int) -> Array:
    """Compute the squared magnitudes (…, m, window/2 + 1) of `short_time_spectra`."""
    return np.asarray(np.abs(short_time_spectra(signal, window, hop)) ** 2)


def window_energy(window: int) -> float:
    """Return Σ w², by which a power is one of white noise of variance 1."""
    return float((np.hanning(window) ** 2).sum())
