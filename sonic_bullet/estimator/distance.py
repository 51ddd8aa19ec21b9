"""How far apart two sounds are, in decibels, where they stand above the noise.

    D = mean over windows of √<(10 log₁₀ (P_a + ε)/(P_b + ε))²> over cells with (P_a + P_b)/2 > m·N(f)      N: the noise's power in a cell

P: power of a short-time spectrum under a Hann window. Multi-resolution, as one window favours either onsets or close pairs
[Yamamoto et al. 2020, section 3.1]. Two takes of one sound differ by their noise: `noise_floor_db` is that distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array

WINDOWS = (512, 2048, 8192)
ABOVE = 10.0  # m: cells 10 dB above the noise count
FLOOR_WINDOW = 1024


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """A stationary noise: variance_per_bin (b,) of white noise that had this density at all frequencies, from 0 to half the rate."""

    variance: Array

    def at(self, bins: int) -> Array:
        """The same at another number of bins (bins,)."""
        return np.asarray(np.interp(np.linspace(0, 1, bins), np.linspace(0, 1, len(self.variance)), self.variance))


def floor_of(residual: Array) -> Floor:
    """The floor of what is left of a recording (n,) without its modes: medians over time, so that what still rings does not count."""
    window = min(FLOOR_WINDOW, len(residual) // 4)
    shape = np.hanning(window)
    frames = np.lib.stride_tricks.sliding_window_view(residual, window)[:: window // 2]
    power = np.abs(np.fft.rfft(frames * shape, axis=1)) ** 2 / (shape**2).sum()
    return Floor(np.maximum(np.median(power, axis=0) / np.log(2), 1e-24))  # the median of an exponential law is ln 2 of its mean


def white(rms: float) -> Floor:
    """White noise of an rms a sample."""
    return Floor(np.full(2, rms**2))


def log_spectral_db(a: Array, b: Array, floor: Floor, *, windows: tuple[int, ...] = WINDOWS, above: float = ABOVE) -> float:
    """Distance D of two sounds (n,), each with a noise like ``floor`` in it; NaN where no cell stands above it.

    A sound without noise (a prediction) must be given some, or its silence counts: see `with_noise`.
    """
    found = []
    for window in windows:
        if window > len(a):
            continue
        power_a, power_b, cell = _power(a, window), _power(b, window), floor.at(window // 2 + 1) * (np.hanning(window) ** 2).sum()
        heard = (power_a + power_b) / 2 > above * cell
        if heard.any():
            tiny = np.broadcast_to(1e-3 * cell, heard.shape)[heard]
            found.append(np.sqrt(((10 * np.log10((power_a[heard] + tiny) / (power_b[heard] + tiny))) ** 2).mean()))
    return float(np.mean(found)) if found else float("nan")


def with_noise(sound: Array, floor: Floor, seed: int) -> Array:
    """The sound (n,) plus Gaussian noise like ``floor``."""
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(len(sound)))
    return np.asarray(sound + np.fft.irfft(spectrum * np.sqrt(floor.at(len(spectrum))), len(sound)))


def noise_floor_db(sound: Array, floor: Floor, *, seeds: tuple[int, int] = (1, 2), windows: tuple[int, ...] = WINDOWS, above: float = ABOVE) -> float:
    """D of two noisy takes of one clean sound (n,)."""
    return log_spectral_db(with_noise(sound, floor, seeds[0]), with_noise(sound, floor, seeds[1]), floor, windows=windows, above=above)


def _power(sound: Array, window: int) -> Array:
    frames = np.lib.stride_tricks.sliding_window_view(sound, window)[:: window // 4]
    return np.asarray(np.abs(np.fft.rfft(frames * np.hanning(window), axis=1)) ** 2)
