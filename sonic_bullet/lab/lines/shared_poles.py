"""Several recordings of one object -> rough poles that they share, band by band.

The likelihood of joint_lines.py starts there.

    bands, decimated; poles = eigenvalues of the shift between the rows of the signal subspace of all recordings at once
        (ESPRIT) [Roy & Kailath 1989, eq. 3.12-3.17]
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from sonic_bullet.lab.lines.subspace import shift_poles
from sonic_bullet.machine.parallel import parallel_map
from sonic_bullet.records import Array

FASTEST_PER_S = 2500.0


@dataclass(frozen=True, slots=True, eq=False)
class _Band:
    """Series (s, m) about centre_hz, every step-th sample, of unit noise, from its filter's first full sample on."""

    centre_hz: float
    step: int
    series: Array


def start_poles(signals: Array, sr: int, low: float, high: float) -> Array:
    """Poles −d + iω (k,) band by band; signals in units of their noise."""

    def within(edges: tuple[float, float]) -> Array:
        band = _band(signals, sr, edges)
        found = _subspace(band.series, band.step / sr)
        freq = band.centre_hz + found.imag / (2 * np.pi)
        keep = (freq >= edges[0]) & (freq < edges[1]) & (found.real < 0) & (found.real > -FASTEST_PER_S)
        return np.asarray(found[keep].real + 2j * np.pi * freq[keep])

    return np.concatenate([np.zeros(0, complex), *parallel_map(within, _edges(signals.shape[1], sr, low, high))])


def power_beside_lines(signal: Array, sr: int, band_hz: tuple[float, float], late_s: float, enough: float) -> float:
    """Mean power that damped sinusoids leave of a signal (n,) from late_s on, in units of its white noise's.

    By bands, the loudest first: of more than ``enough`` it is a lower bound.
    """
    power = np.abs(np.fft.rfft(signal)) ** 2
    edges = _edges(len(signal), sr, *band_hz)
    energy = [power[int(len(signal) * low / sr) : int(len(signal) * high / sr) + 1].sum() for low, high in edges]
    left = 0.0
    for k in np.argsort(energy)[::-1]:
        band = _band(signal[None], sr, edges[k])
        series, late = band.series[0], min(round(late_s * sr / band.step), band.series.shape[1] // 4)
        pole = _subspace(band.series, 1.0)
        rings = np.vander(np.exp(pole[pole.real < 0]), len(series), increasing=True).T
        amplitude = np.linalg.pinv(rings.conj().T @ rings, hermitian=True) @ (rings.conj().T @ series)
        width = (edges[k][1] - edges[k][0]) / (edges[-1][1] - edges[0][0])
        left += width * float((np.abs(series - rings @ amplitude)[late:] ** 2).mean())
        if left > enough:
            break
    return left


def _edges(samples: int, sr: int, low: float, high: float) -> list[tuple[float, float]]:
    """Return the bands of so many samples in Hz; of too few to filter there is one."""
    fewest = 36  # samples of a band, of which a filter takes a third and a window a third of the rest
    if samples * 2.2 * _width(low) < fewest * sr:
        return [(low, high)]
    edges = [low]
    while edges[-1] < high:
        edges.append(edges[-1] + _width(edges[-1]))
    return list(pairwise([*edges[:-1], min(edges[-1], high)]))


def _band(signals: Array, sr: int, edges: tuple[float, float]) -> _Band:
    """Shift signals (s, n) by a band's centre, low-pass them, and keep every step-th sample."""
    width = max(edges[1] - edges[0], _width(edges[0]))
    step = max(1, int(sr / (2.2 * width)))
    if step == 1:
        return _Band(0.0, 1, signals.astype(complex))
    centre_hz = edges[0] + width / 2
    taps = _low_pass(min(2 * int(1.9 * sr / width) + 1, signals.shape[1] // 3), 0.85 * width / sr)
    turn = 2j * np.pi * centre_hz / sr
    kernel = taps / np.sqrt((taps**2).sum()) * np.exp(-turn * np.arange(len(taps)))
    both = np.stack([kernel.real, kernel.imag], axis=1)
    series = np.array([sliding_window_view(one, len(taps))[::step] @ both for one in signals])
    back = np.exp(-turn * step * np.arange(series.shape[1]))
    return _Band(centre_hz, step, (series[..., 0] + 1j * series[..., 1]) * back)


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
