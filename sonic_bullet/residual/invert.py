"""From a power spectrogram back to samples: the iterative inverse short-time transform, ten turns at most.

    S ← A·C/|C|,  C = T(T⁻¹(S))                                 magnitudes kept, phases made consistent     [Griffin & Lim 1984, eq. 8]
    S ← A·Q/|Q|,  Q = C + μ (C - C before)                       with momentum                              [Perraudin et al. 2013, algorithm 2]

A = √P. It starts from phases that are given: the source's, where there is a source, those of seeded noise else.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.records import Array
from sonic_bullet.residual.spectrogram import WINDOW, hann, inverse, transform

ITERATIONS = 8
MOST_ITERATIONS = 10
MOMENTUM = 0.5


def invert(magnitude: Array, start: Array, n: int, *, iterations: int = ITERATIONS, momentum: float = MOMENTUM, window: int = WINDOW) -> Array:
    """Samples (n,) float32 of magnitudes |S| (m, k), from complex ``start`` (m, k) whose phases alone count. iterations: 0 … 10."""
    if not 0 <= iterations <= MOST_ITERATIONS:
        raise ValueError(f"{iterations} iterations: 0 to {MOST_ITERATIONS}")
    magnitude = np.ascontiguousarray(magnitude, np.float32)
    spectrum = np.ascontiguousarray(start, np.complex64).copy()
    before = np.zeros_like(spectrum)
    _phased(spectrum, before, magnitude, np.float32(0.0))
    for turn in range(iterations):
        sample = inverse(spectrum, n, window)
        spectrum = transform(sample, window)
        _phased(spectrum, before, magnitude, np.float32(momentum if turn else 0.0))
    return inverse(spectrum, n, window)


def noise_phases(n: int, seed: int, window: int = WINDOW) -> Array:
    """(m, k) complex64: the transform of white noise (n,), whose phases are consistent with each other."""
    return transform(np.random.default_rng(seed).standard_normal(n, np.float32), window)


def magnitude_of(per_hz: Array, sr: int, window: int = WINDOW) -> Array:
    """|S| (m, k) of powers per Hz (k, m)."""
    return np.asarray(np.sqrt(per_hz.T * (sr * float((hann(window).astype(float) ** 2).sum()))), np.float32)


def inconsistency(magnitude: Array, sample: Array, window: int = WINDOW) -> float:
    """‖|T(x)| - A‖/‖A‖: how far samples are from having the magnitudes asked for."""
    return float(np.linalg.norm(np.abs(transform(sample, window)) - magnitude) / max(float(np.linalg.norm(magnitude)), 1e-300))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _phased(spectrum: Array, before: Array, magnitude: Array, momentum: np.float32) -> None:  # pragma: no cover - compiled
    """spectrum ← magnitude·Q/|Q|, Q = spectrum + momentum (spectrum - before); before ← spectrum as it came."""
    for m in range(spectrum.shape[0]):
        for k in range(spectrum.shape[1]):
            now = spectrum[m, k]
            re = now.real + momentum * (now.real - before[m, k].real)
            im = now.imag + momentum * (now.imag - before[m, k].imag)
            before[m, k] = now
            size = np.sqrt(re * re + im * im)
            scale = magnitude[m, k] / size if size > 1e-30 else np.float32(0.0)
            spectrum[m, k] = complex(re * scale, im * scale)
