"""Spectra of pieces of a signal under a window.

X[m, k] = Σ_n w[n] x[n + m·hop] e^{−2πikn/N},  w[n] = (1 − cos 2πn/(N−1))/2               [Harris 1978, eq. 27a]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def power_spectrum(signal: Array, window: Array | None = None, size: int | None = None) -> Array:
    """Compute |Σ_n w[n] x[n] e^{−2πikn/N}|² of whole signals.

    Parameters
    ----------
    signal : (…, n)
        The signals.
    window : (n,)
        w; ones where None.
    size : int
        N, zeros after the signal; n where None.

    Returns
    -------
    (…, N/2 + 1) array
        Squared magnitudes. Over Σ w², one of white noise of variance 1 has the mean 1.
    """
    return np.asarray(np.abs(np.fft.rfft(signal if window is None else signal * window, size, axis=-1)) ** 2)


def filter_circular(signal: Array, gain: Array, size: int | None = None) -> Array:
    """Filter whole signals by a gain over frequency, circularly over N samples.

    Parameters
    ----------
    signal : (…, n)
        The signals.
    gain : (…, N/2 + 1)
        Factors of the spectrum, complex where they delay.
    size : int
        N, zeros after the signal; n where None. What a filter of t taps adds wraps around where N < n + t − 1.

    Returns
    -------
    (…, N) array
        y, of Y[k] = G[k] X[k]                                             [Oppenheim & Schafer 2010, sec. 8.7.2].
    """
    size = signal.shape[-1] if size is None else size
    return np.asarray(np.fft.irfft(np.fft.rfft(signal, size) * gain, size))


def short_time_spectra(signal: Array, window: int | Array, hop: int) -> Array:
    """Compute the spectra of frames that lie wholly inside a signal.

    Parameters
    ----------
    signal : (…, n)
        The signals.
    window : int or (N,)
        Length of a Hann window in samples, or a window.
    hop : int
        Samples between two frames.

    Returns
    -------
    (…, m, N/2 + 1) complex array
        X.
    """
    shape = window if isinstance(window, np.ndarray) else np.hanning(window)
    frames = np.lib.stride_tricks.sliding_window_view(signal, len(shape), axis=-1)[..., ::hop, :]
    return np.asarray(np.fft.rfft(frames * shape, axis=-1))


def short_time_power(signal: Array, window: int | Array, hop: int) -> Array:
    """Compute the squared magnitudes (…, m, N/2 + 1) of `short_time_spectra`."""
    return np.asarray(np.abs(short_time_spectra(signal, window, hop)) ** 2)


def window_energy(window: int) -> float:
    """Return Σ w² of a Hann window, by which a power is one of white noise of variance 1."""
    return float((np.hanning(window) ** 2).sum())


def positive_hann(length: int) -> Array:
    """Return the Hann window (length,) without the zeros at its ends: w[n] = (1 − cos 2π(n + 1)/(N + 1))/2."""
    return np.asarray(np.hanning(length + 2)[1:-1])


def raised_cosine(fraction: Array) -> Array:
    """Return half a Hann window, (1 − cos πx)/2: 0 below x = 0, 1 above x = 1, without corners."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.clip(fraction, 0, 1)))
