"""Several recordings of one object -> rough poles that they share, band by band.

The likelihood of joint_lines.py starts there.

    bands, decimated; poles = eigenvalues of the shift between the rows of the signal subspace of all recordings at once
        (ESPRIT) [Roy & Kailath 1989, eq. 3.12-3.17]
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.lines.subspace import shift_poles
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array

FASTEST_PER_S = 2500.0


def start_poles(signals: Array, sr: int, low: float, high: float) -> Array:
    """Poles −d + iω (k,) band by band; signals in units of their noise."""
    n = signals.shape[1]
    whole = 1 << int(np.ceil(np.log2(2 * n)))
    spectrum = np.fft.fft(signals, whole, axis=1)
    edges = [low]
    while edges[-1] < high:
        edges.append(edges[-1] + _width(edges[-1]))

    def within(edge: float) -> Array:
        width = _width(edge)
        bin_number = round((edge + width / 2) / sr * whole)
        centre = bin_number * sr / whole
        step = max(1, int(sr / (2.2 * width)))
        taps = _low_pass(min(2 * int(1.9 * sr / width) + 1, n // 3), 0.85 * width / sr) if step > 1 else np.ones(1)
        band = np.fft.ifft(np.roll(spectrum, -bin_number, axis=1) * np.fft.fft(taps, whole), axis=1)[
            :, len(taps) - 1 : n : step
        ]
        band /= np.sqrt((taps**2).sum())
        found = _subspace(band, step / sr)
        freq = centre + found.imag / (2 * np.pi)
        keep = (freq >= edge) & (freq < min(edge + width, high)) & (found.real < 0) & (found.real > -FASTEST_PER_S)
        return np.asarray(found[keep].real + 2j * np.pi * freq[keep])

    return np.concatenate([np.zeros(0, complex), *parallel_map(within, edges[:-1])])


def _width(edge: float) -> float:
    """Of a band from an edge on, in Hz."""
    return max(350.0, 0.09 * edge)


def _low_pass(taps: int, cutoff: float) -> Array:
    """Hamming-windowed sinc (taps,), cutoff in cycles a sample [Oppenheim & Schafer 2010, ch. 7.5]."""
    at = np.arange(taps) - (taps - 1) / 2
    kernel = np.sinc(2 * cutoff * at) * np.hamming(taps)
    return np.asarray(kernel / kernel.sum())


def _subspace(band: Array, dt: float) -> Array:
    """Return poles of complex series (s, n) of unit noise at step dt: their one signal subspace, then the shift."""
    most_window, most_columns = 300, 1200  # of the data matrix of one recording
    s, n = band.shape
    window = min(most_window, n // 3)
    if window < 8:
        return np.zeros(0, complex)
    # any columns will do: the shift is between rows
    first = np.arange(0, n - window + 1, 1 + (n - window) // most_columns)
    gram = np.zeros((window, window), complex)
    for row in band:
        data = row[first[:, None] + np.arange(window)]
        gram += data.T @ data.conj()
    value, vector = np.linalg.eigh(gram)
    columns = s * len(first)
    floor = max(float(np.median(value)) / columns, 0.3)
    edge = floor * columns * (1 + np.sqrt(window / columns)) ** 2
    order = min(int((value > 2.0 * edge).sum()), window // 3)
    if order == 0:
        return np.zeros(0, complex)
    return shift_poles(vector[:, -order:]) / dt
