"""How far apart two sounds are, in decibels, where they stand above the noise.

    D = mean over windows of √<(10 log₁₀ (P_a + ε)/(P_b + ε))²> over cells with (P_a + P_b)/2 > m·N(f)
        N: the noise's power in a cell

P: power of a short-time spectrum under a Hann window. Multi-resolution, as one window favours either onsets or close
pairs [Yamamoto et al. 2020, section 3.1]. Two takes of one sound differ by their noise: `noise_floor_db` is that
distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Array
from sonic_bullet.signal.exponential_law import mean_by_median, mean_by_quartile
from sonic_bullet.signal.short_time import filter_circular, short_time_power, window_energy

SPECTRAL_WINDOWS = (512, 2048, 8192)
ABOVE_NOISE = 10.0  # m: cells 10 dB above the noise count
FEWEST_CELLS = 20  # of a window that may speak for itself
FLOOR_WINDOW = 1024
HIDING_VARIANCE = 1e30  # over which nothing stands


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Floor:
    """A stationary noise.

    variance (b,): of white noise that had this density at all frequencies, from 0 to half the rate.
    """

    variance: Array

    def at(self, bins: int) -> Array:
        """Return the same at another number of bins (bins,).

        Fewer are each what a Hann window of their width takes in, as noise may be steep.
        """
        return _at(self, bins)

    def density(self, freq_hz: Array, sr: int) -> Array:
        """Return the variance of white noise as dense as it is at frequencies (k,)."""
        return np.asarray(np.interp(freq_hz, np.linspace(0, sr / 2, len(self.variance)), self.variance))

    def over(self, other: Floor) -> Floor:
        """Return the louder of two at every frequency."""
        bins = max(len(self.variance), len(other.variance))
        return Floor(np.maximum(self.at(bins), other.at(bins)))

    def within(self, sr: int, band_hz: tuple[float, float]) -> Floor:
        """Limit it to a band: outside it no sound stands above the noise."""
        freq = np.linspace(0, sr / 2, len(self.variance))
        return Floor(np.where((freq < band_hz[0]) | (freq > band_hz[1]), HIDING_VARIANCE, self.variance))


@WhileAlive
def _at(floor: Floor, bins: int) -> Array:
    """Return the variance of a floor at another number of bins (bins,), which every comparison asks for."""
    fine, wide = len(floor.variance), (len(floor.variance) - 1) / max(bins - 1, 1)
    found = np.interp(
        np.linspace(0, 1, bins),
        np.linspace(0, 1, fine),
        _taken_in(floor.variance, wide) if wide > 1.5 else floor.variance,
    )
    found.flags.writeable = False
    return np.asarray(found)


def _taken_in(variance: Array, wide: float) -> Array:
    """Means (b,) under the main lobe of a Hann window whose bins are ``wide`` of these apart."""
    from scipy.ndimage import convolve1d  # 0.3 s to load, and lines of a recording need only its floor

    x = np.arange(-int(2 * wide), int(2 * wide) + 1) / wide
    with np.errstate(divide="ignore", invalid="ignore"):
        lobe = np.where(np.abs(np.abs(x) - 1) < 1e-9, 0.5, np.sinc(x) / (1 - x**2)) ** 2  # [Harris 1978, eq. 27]
    return np.asarray(convolve1d(variance, lobe / lobe.sum(), mode="mirror"))


def floor_of(residual: Array) -> Floor:
    """Return the floor of what is left of a recording (n,) without its modes.

    Medians over time, so that what still rings does not count.
    """
    window = min(FLOOR_WINDOW, len(residual) // 4)
    power = short_time_power(residual, window, window // 2) / window_energy(window)
    return Floor(np.maximum(mean_by_median(power, 0), 1e-24))


def floor_between(signals: list[Array]) -> Floor:
    """Return the stationary noise that recordings (n,) share.

    Per bin the lower quartile over the last third of every recording, and over neighbouring bins, as no noise is narrow
    (hum is no noise).
    """
    most = 8192  # of its window, where recordings are long: low noise needs narrow bins
    side = 8  # bins of the short window to each side
    length = min(len(signal) for signal in signals)
    window = max(FLOOR_WINDOW, 1 << int(np.log2(max(min(length // 6, most), 1))))
    rows = []
    for signal in signals:
        tail = signal[-max(len(signal) // 3, min(len(signal), 2 * window)) :]
        if len(tail) < window:
            tail = np.pad(tail, (0, window - len(tail)))
        rows.append(short_time_power(tail, window, window // 2) / window_energy(window))
    level = mean_by_quartile(np.concatenate(rows), 0)
    return Floor(np.maximum(_broad(level, side * window // FLOOR_WINDOW), 1e-24))


def _broad(level: Array, side: int) -> Array:
    """Return what neighbours (b,) agree on.

    ``side`` bins to each side, and no further than a factor, as a noise may fall steeply with frequency.
    """
    reach = 2.5  # of a frequency, up and down: more than a strong hum and its skirt take up
    count = len(level)
    k = np.arange(count)
    first = np.maximum(np.ceil(k / reach).astype(int), k - side)
    last = np.minimum(np.minimum(np.floor(k * reach).astype(int), k + side), count - 1)
    found = np.empty(count)
    whole = np.flatnonzero(last - first == 2 * side)
    if len(whole):
        every = np.lib.stride_tricks.sliding_window_view(level, 2 * side + 1)
        found[whole] = np.quantile(every[whole - side], 0.4, axis=1)
    for i in np.flatnonzero(last - first < 2 * side):
        found[i] = np.quantile(level[first[i] : last[i] + 1], 0.4)
    return found


def white(rms: float) -> Floor:
    """White noise of an rms a sample."""
    return Floor(np.full(2, rms**2))


def log_spectral_db(
    a: Array,
    b: Array,
    floor: Floor,
    *,
    windows: tuple[int, ...] = SPECTRAL_WINDOWS,
    above: float = ABOVE_NOISE,
) -> float:
    """Distance D of two sounds (n,), each with a noise like ``floor`` in it; NaN where no cell stands above it.

    A sound without noise (a prediction) must be given some, or its silence counts: see `with_noise`. Windows with
    20 cells speak, or, where none has so many, all: of fewer, one in which noise happens to cancel a sound
    says more than all others.
    """
    return spectra_distance_db(power_spectra(a, windows), power_spectra(b, windows), floor, above=above)


def power_spectra(sound: Array, windows: tuple[int, ...] = SPECTRAL_WINDOWS) -> tuple[Array, ...]:
    """Powers (frames, bins) of a sound (n,) under each window that fits into it."""
    return tuple(short_time_power(sound, window, window // 4) for window in windows if window <= len(sound))


def noise_spectra(floor: Floor, like: tuple[Array, ...]) -> tuple[Array, ...]:
    """Mean powers (1, bins) of the noise under the windows of spectra ``like``."""
    return tuple(floor.at(power.shape[1])[None] * window_energy(2 * (power.shape[1] - 1)) for power in like)


def spectra_distance_db(
    a: tuple[Array, ...], b: tuple[Array, ...], floor: Floor, *, above: float = ABOVE_NOISE
) -> float:
    """Distance D of two sounds by their powers, as `log_spectral_db`."""
    found: list[float] = []
    few: list[float] = []
    for power_a, power_b, cell in zip(a, b, noise_spectra(floor, a), strict=True):
        observed = (power_a + power_b) / 2 > above * cell
        if observed.any():
            tiny = np.broadcast_to(1e-3 * cell, observed.shape)[observed]
            ratio = (power_a[observed] + tiny) / (power_b[observed] + tiny)
            off = float(10 / np.log(10) * np.sqrt((np.log(ratio) ** 2).mean()))  # log10 takes twice as long
            (found if observed.sum() >= FEWEST_CELLS else few).append(off)
    return float(np.mean(found or few)) if found or few else float("nan")


def with_noise(sound: Array, floor: Floor, seed: int) -> Array:
    """Return the sound (n,) plus Gaussian noise like ``floor``."""
    noise = np.random.default_rng(seed).standard_normal(len(sound))
    return np.asarray(sound + filter_circular(noise, np.sqrt(floor.at(len(sound) // 2 + 1))))


def noise_floor_db(
    sound: Array,
    floor: Floor,
    *,
    seeds: tuple[int, int] = (1, 2),
    windows: tuple[int, ...] = SPECTRAL_WINDOWS,
    above: float = ABOVE_NOISE,
) -> float:
    """D of two noisy takes of one clean sound (n,)."""
    return log_spectral_db(
        with_noise(sound, floor, seeds[0]), with_noise(sound, floor, seeds[1]), floor, windows=windows, above=above
    )
