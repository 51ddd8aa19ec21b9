"""The paper's own feature extraction, short: the reference that features.py is measured against [Ren, Yeh, Lin 2013,
section 4, eq. 9].

    power spectrograms of several levels, each with twice the frequency resolution of the one before
    -> peaks along frequency in all levels, by average power density, the strongest first
    -> a damped sinusoid (f, d, a) added to everything found so far; its hill fitted to the recording's near the peak by
        an optimiser
    -> kept where the hill's error is below a threshold, else this level will not do and another level's peak of the
        same mode may

The paper gives neither window, hop, neighbourhood, optimiser nor threshold: here Hann windows of 512 … 16384 samples,
hops of a quarter, ±4 bins, Nelder and Mead over (f, ln d, ln a, φ; φ since hills of close modes interfere), and an
error of 5 % of the hill's norm.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array

LEVELS = (512, 1024, 2048, 4096, 8192, 16_384)
SIDE = 4  # bins each side of a peak
ERROR = 0.05
FLOOR_DB = 80.0
TRIES = 4  # peaks tried for every mode asked for


def greedy(signal: Array, sr: int, most: int, *, evaluations: int = 250) -> Array:
    """Features (k, 3) as (frequency Hz, decay 1/s, amplitude), the strongest peak's first, of a recording (n,) that
    starts at its onset.
    """
    from scipy.optimize import minimize

    kept: list[tuple[float, float, float]] = []
    found = np.zeros(len(signal))
    tried: list[tuple[float, float]] = []
    time = np.arange(len(signal)) / sr
    for _, size, freq_hz in _peaks(signal, sr):
        if len(kept) >= most or len(tried) >= TRIES * most:
            break
        width = sr / size
        if any(abs(freq_hz - f) < max(width, d / np.pi) for f, d, _ in kept) or (freq_hz, width) in tried:
            continue
        bins = np.arange(max(1, round(freq_hz / width) - SIDE), min(size // 2, round(freq_hz / width) + SIDE + 1))
        kernel = np.hanning(size)[:, None] * np.exp(-2j * np.pi * np.outer(np.arange(size), bins) / size)
        frames, before = (
            np.lib.stride_tricks.sliding_window_view(x, size)[:: size // 4] @ kernel for x in (signal, found)
        )
        hill = np.abs(frames) ** 2
        at = np.arange(len(frames)) * (size // 4) / sr
        slope = (
            np.polyfit(at[: max(3, len(at) // 4)], np.log(hill.sum(axis=1) + 1e-300)[: max(3, len(at) // 4)], 1)[0]
            if len(at) > 2
            else -20.0
        )

        def shape(p: Array) -> tuple[Array, float]:
            """One damped sinusoid's frames: its first frame's, turned and faded from hop to hop."""
            pole = complex(-np.exp(p[1]), 2 * np.pi * p[0])
            first = 0.5 * np.exp(np.arange(size) / sr * pole) @ kernel  # noqa: B023 - used within this turn of the loop
            return np.exp(pole * at)[:, None] * first, float(np.exp(p[1]))  # noqa: B023

        def misfit(p: Array) -> float:
            one, _ = shape(p)
            left = np.abs(before + np.exp(p[2] + 1j * p[3]) * one) ** 2 - hill  # noqa: B023
            return float((left**2).sum() / (hill**2).sum())  # noqa: B023

        start = np.array([freq_hz, np.log(np.clip(-slope / 2, 0.1, 1000.0)), 0.0, 0.0])
        one, _ = shape(start)
        guess = np.vdot(one, frames - before) / np.vdot(one, one)
        start[2:] = np.log(abs(guess) + 1e-12), np.angle(guess)
        simplex = start + np.vstack([np.zeros(4), np.diag([0.3 * width, 0.5, 0.3, 0.5])])
        best = minimize(
            misfit,
            start,
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": evaluations, "xatol": 1e-7, "fatol": 1e-14},
        )
        tried.append((freq_hz, width))
        if best.fun > ERROR**2 or abs(best.x[0] - freq_hz) > 2 * width:
            continue
        f, d, a = float(best.x[0]), float(np.exp(best.x[1])), float(np.exp(best.x[2]))
        kept.append((f, d, a))
        found += a * np.exp(-d * time) * np.cos(2 * np.pi * f * time + best.x[3])
    return np.array(kept).reshape(-1, 3)


def _peaks(signal: Array, sr: int) -> list[tuple[float, int, float]]:
    """(average power density, window, frequency) of every local maximum along frequency in every level, the strongest
    first.
    """
    peaks = []
    for size in LEVELS:
        if size > len(signal):
            continue
        frames = np.lib.stride_tricks.sliding_window_view(signal, size)[:: size // 4] * np.hanning(size)
        density = (np.abs(np.fft.rfft(frames, axis=1)) ** 2).mean(axis=0) / size
        top = (
            np.flatnonzero(
                (density[1:-1] > density[:-2])
                & (density[1:-1] >= density[2:])
                & (density[1:-1] > density.max() * 10 ** (-FLOOR_DB / 10))
            )
            + 1
        )
        peaks += [(float(density[k]), size, k * sr / size) for k in top]
    return sorted(peaks, key=lambda peak: -peak[0])
