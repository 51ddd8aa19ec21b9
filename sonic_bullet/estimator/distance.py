"""How far apart two sounds are, in decibels, where they stand above the noise.

    D = mean over windows of √<(10 log₁₀ (P_a + ε)/(P_b + ε))²> over cells with (P_a + P_b)/2 > m·N      N: the noise's power in a cell

P: power of a short-time spectrum under a Hann window. Multi-resolution, as one window favours either onsets or close pairs
[Yamamoto et al. 2020, section 3.1]. Two takes of one sound differ by their noise: `noise_floor_db` is that distance.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array

WINDOWS = (512, 2048, 8192)
ABOVE = 10.0  # m: cells 10 dB above the noise count


def log_spectral_db(a: Array, b: Array, noise_rms: float, *, windows: tuple[int, ...] = WINDOWS, above: float = ABOVE) -> float:
    """Distance D of two sounds (n,) of white noise noise_rms each; NaN where no cell stands above it.

    A sound without noise (a prediction) must be given some, or its silence counts: see `with_noise`.
    """
    found = []
    for window in windows:
        if window > len(a):
            continue
        power_a, power_b, cell = _power(a, window), _power(b, window), _cell(noise_rms, window)
        heard = (power_a + power_b) / 2 > above * cell
        if heard.any():
            tiny = 1e-3 * cell + 1e-30
            ratio = 10 * np.log10((power_a[heard] + tiny) / (power_b[heard] + tiny))
            found.append(np.sqrt((ratio**2).mean()))
    return float(np.mean(found)) if found else float("nan")


def with_noise(sound: Array, noise_rms: float, seed: int) -> Array:
    """The sound (n,) plus white noise."""
    return np.asarray(sound + noise_rms * np.random.default_rng(seed).standard_normal(len(sound)))


def noise_floor_db(sound: Array, noise_rms: float, *, seeds: tuple[int, int] = (1, 2), windows: tuple[int, ...] = WINDOWS, above: float = ABOVE) -> float:
    """D of two noisy takes of one clean sound (n,)."""
    return log_spectral_db(with_noise(sound, noise_rms, seeds[0]), with_noise(sound, noise_rms, seeds[1]), noise_rms, windows=windows, above=above)


def _power(sound: Array, window: int) -> Array:
    frames = np.lib.stride_tricks.sliding_window_view(sound, window)[:: window // 4]
    return np.asarray(np.abs(np.fft.rfft(frames * np.hanning(window), axis=1)) ** 2)


def _cell(noise_rms: float, window: int) -> float:
    return float(noise_rms**2 * (np.hanning(window) ** 2).sum())
