"""Inversion of a power spectrogram to samples: the iterative inverse short-time transform, ten iterations at most.

    S ← A·C/|C|,  C = T(T⁻¹(S))                                 magnitudes kept, phases made consistent
        [Griffin & Lim 1984, eq. 8]
    S ← A·Q/|Q|,  Q = C + μ (C - C before)                       with momentum
        [Perraudin et al. 2013, algorithm 2]

A = √P. It starts from given phases: the source's, where there is a source, else those of seeded noise.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from sonic_bullet._engine import renew_phases
from sonic_bullet.records import Array
from sonic_bullet.signal.spectrogram import RESIDUAL_WINDOW, frame_count, hann, inverse, transform

INVERSION_ITERATIONS = 4
MOST_INVERSION_ITERATIONS = 10
INVERSION_MOMENTUM = 0.99
# with frames half a window apart four iterations leave 10 % inconsistent, where a quarter apart ten leave 20 %
# (noise with a decay, momentum 0.99)
INVERSION_OVERLAP = 2


def invert(
    magnitude: Array,
    start: Array,
    n: int,
    *,
    iterations: int = INVERSION_ITERATIONS,
    momentum: float = INVERSION_MOMENTUM,
    window: int = RESIDUAL_WINDOW,
    overlap: int = INVERSION_OVERLAP,
) -> Array:
    """Compute samples (n,) float32 of magnitudes |S| (m, k), from complex ``start`` (m, k) whose phases alone count.

    iterations: 0 … 10.
    """
    if not 0 <= iterations <= MOST_INVERSION_ITERATIONS:
        raise ValueError(f"{iterations} iterations: 0 to {MOST_INVERSION_ITERATIONS}")
    wanted = np.ascontiguousarray(magnitude, np.float32)
    now = np.array(start, np.complex64, order="C")
    before = np.zeros_like(now)
    renew_phases(now, before, wanted, 0.0)
    for turn in range(iterations):
        now = transform(inverse(now, n, window, overlap), window, overlap)
        renew_phases(now, before, wanted, momentum if turn else 0.0)
    return inverse(now, n, window, overlap)


def noise_phases(n: int, seed: int, window: int = RESIDUAL_WINDOW, overlap: int = INVERSION_OVERLAP) -> Array:
    """Return the transform (m, k) complex64 of white noise, whose phases are consistent with each other.

    A longer grain's are the same, as far as both go.
    """
    longest_noise = 1 << 18
    frames = frame_count(n, window, overlap)
    longest = max(longest_noise, 1 << int(np.ceil(np.log2(n + window))))
    return _noise(longest, seed, window, overlap)[:frames]


@lru_cache(maxsize=4)
def _noise(n: int, seed: int, window: int, overlap: int) -> Array:
    phases = transform(np.random.default_rng(seed).standard_normal(n, np.float32), window, overlap)
    phases.setflags(write=False)
    return phases


def magnitude_of(per_hz: Array, sr: int, window: int = RESIDUAL_WINDOW) -> Array:
    """Compute |S| (m, k) of powers per Hz (k, m)."""
    return np.asarray(np.sqrt(per_hz.T * (sr * float((hann(window).astype(float) ** 2).sum()))), np.float32)
