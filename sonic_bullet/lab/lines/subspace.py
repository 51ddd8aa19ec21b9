"""Poles of a recording band by band: where the joint fit starts.

    shift the band to zero, low-pass, keep every s-th sample: damped sinusoids stay damped sinusoids, exactly, once the
        filter is full
    Hankel matrix H of the band = U S Vᴴ, as many columns of U as stand above the noise: pole = eigenvalue of the shift
        between their rows
        [Roy & Kailath 1989, eq. 3.12-3.17; Hua & Sarkar 1990]
    noise: singular values of white noise end at σ(√rows + √columns)    [Marchenko & Pastur 1967]

The stop band lies below any converter's noise; recordings without noise are exact_modes.py's.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def low_pass(passed: float, stopped: float, stop_db: float) -> Array:
    """Taps (l,), l odd, of a linear-phase low-pass with gain 1 at 0 Hz.

    passed, stopped: edges of what goes through and of what is ``stop_db`` (> 50) lower, over the rate.
    """
    half = int((stop_db - 7.95) / (2.285 * 2 * np.pi * (stopped - passed))) // 2
    taps = np.sinc((passed + stopped) * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, 0.1102 * (stop_db - 8.7))
    return np.asarray(taps / taps.sum())


def poles(
    signal: Array, sr: int, noise: Array, band_hz: tuple[float, float], width_hz: float, fastest_per_s: float
) -> Array:
    """Return poles −d + iω (k,) of a signal (n,), 1/s, in bands of width_hz.

    noise (n_f,): rms density per sample at `rfft`'s frequencies of 0 … sr/2.

    A band is a slice of the whole recording's transform, times the filter's, turned back at the lower rate: the same
    linear convolution.
    """
    stop_db = 160.0
    oversampled = 2.5
    from scipy.fft import fft, ifft, next_fast_len

    found = []
    step = max(1, int(sr / (oversampled * width_hz)))
    rate = sr / step
    taps = np.ones(1)
    if step > 1:
        taps = low_pass(width_hz / 2 / sr, (rate - width_hz / 2) / sr, stop_db)
    points = next_fast_len(-(-(len(signal) + len(taps)) // step))
    size = points * step
    sound, offset = fft(signal, size), (np.arange(points) + points // 2) % points - points // 2
    weight = fft(taps, size)[offset] / step
    for low in np.arange(band_hz[0], band_hz[1], width_hz):
        high = min(low + width_hz, band_hz[1])
        at = round((low + high) / 2 / sr * size)
        centre = at * sr / size
        band = ifft(sound[(at + offset) % size] * weight)[-(-(len(taps) - 1) // step) : (len(signal) - 1) // step + 1]
        here = noise[int(low / sr * 2 * (len(noise) - 1)) : int(high / sr * 2 * (len(noise) - 1)) + 2]
        pole = _series_poles(band, float(np.median(here))) * rate
        freq = centre + pole.imag / (2 * np.pi)
        keep = (freq >= low) & (freq < high) & (pole.real < 0) & (pole.real > -fastest_per_s)
        found.append(pole[keep].real + 2j * np.pi * freq[keep])
    return np.concatenate(found) if found else np.zeros(0, complex)


def early_poles(signal: Array, sr: int, noise: Array, band_hz: tuple[float, float], fastest_per_s: float) -> Array:
    """Return poles (k,) of the first `early` samples, no filter before them: a band's filter outlasts the fast ones."""
    early = 1500  # samples
    pole = _series_poles(signal[:early], float(np.median(noise)), early // 3, early // 9) * sr
    freq = pole.imag / (2 * np.pi)
    return np.asarray(pole[(freq >= band_hz[0]) & (freq < band_hz[1]) & (pole.real < 0) & (pole.real > -fastest_per_s)])


def _series_poles(band: Array, noise: float, widest: int = 140, most: int = 40) -> Array:
    """Return poles per sample of a series (n,) in white noise of that rms.

    widest: of the window; most: how many poles.
    """
    # of the largest singular value, by way of H Hᴴ: enough for what a converter writes; exact_modes.py is for the rest
    rounding = 1e-7
    columns_most = 1200
    n = len(band)
    window = min(widest, n // 3)
    if window < 6:
        return np.zeros(0, complex)
    # the shift is between rows: any columns will do
    first = np.arange(0, n - window + 1, 1 + (n - window) // columns_most)
    hankel = band[first[None, :] + np.arange(window)[:, None]]
    power, left = np.linalg.eigh(hankel @ hankel.conj().T)
    size, left = np.sqrt(np.maximum(power[::-1], 0)), left[:, ::-1]
    edge = max(1.05 * noise * (np.sqrt(len(first)) + np.sqrt(window)), rounding * size[0])
    order = min(int((size > edge).sum()), window - 2, most)
    if order == 0:
        return np.zeros(0, complex)
    return shift_poles(left[:, :order])


def shift_poles(basis: Array) -> Array:
    """Return poles per step (k,) of an orthonormal basis (n, k) of a sum of exponentials: the shift between its rows.

    Of its rows but the last, V₁ᴴV₁ = I − v̄ vᵀ, by which the shift needs no least squares.
    """
    last, shift = basis[-1], basis[:-1].conj().T @ basis[1:]
    shift = shift + np.outer(last.conj(), last @ shift) / max(1 - float(np.vdot(last, last).real), 1e-12)
    value = np.linalg.eigvals(shift)
    return np.asarray(np.log(value[np.abs(value) > 1e-12].astype(complex)))
