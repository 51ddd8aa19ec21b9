"""What in a recording is no mode: its density over frequency and its course over time, both blind to lines.

    σ(f): rms per sample as if white at the level of f, from a neighbourhood's |X|², whose law is exponential: its lower
        quartile is ln(4/3) of the
          mean; once the modes are gone, the lower half, σ² = (Σ_{i≤r} x_(i) + (N − r) x_(r))/r, r = N/2, scatters less
              [Epstein & Sobel 1953]
    e(t): power over time in frames, the median over frequency of |X_m(f)|²/σ²(f), ln 2 of the mean; 1 throughout where
        noise is steady
    a mode of decay d meets σ²(f) Σ e(t) e^{−2dt} / Σ e^{−2dt}

A struck thing's first milliseconds hold what no mode explains (the striker, slaps from near walls); without e(t) every
one of them would be taken for many fast modes, and the spreads of the fast ones would be too small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.exponential_law import mean_by_median
from sonic_bullet.signal.peaks import local_peaks
from sonic_bullet.signal.short_time import positive_hann, power_spectrum

FRAME = 256


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Noise over frequency and time.

    density (n_f,): rms per sample over 0 … sr/2. course (m,): of the power in frames of FRAME samples, in units of its
    density.
    """

    density: Array
    course: Array
    sr: int

    def rms(self, freq_hz: Array, decay_per_s: Array) -> Array:
        """Rms per sample (k,) that modes of these frequencies and decays meet."""
        return self.at(freq_hz) * np.sqrt(self.share(decay_per_s))

    def at(self, freq_hz: Array) -> Array:
        """Density (k,) at a frequency, over all time."""
        return np.asarray(np.interp(freq_hz, np.linspace(0, self.sr / 2, len(self.density)), self.density))

    def share(self, decay_per_s: Array) -> Array:
        """Noise power (k,) under modes of these decays, over the mean."""
        fade = np.exp(
            np.maximum(-2 * np.asarray(decay_per_s)[:, None] * (FRAME / self.sr) * np.arange(len(self.course)), -80)
        )
        return np.asarray(fade @ self.course / fade.sum(axis=1))


def white(rms: float, sr: int) -> Noise:
    """Steady white noise."""
    return Noise(np.full(2, rms), np.ones(1), sr)


def measured(left: Array, sr: int, floor: float, modes: int = 0, band_hz: tuple[float, float] = (0.0, np.inf)) -> Noise:
    """Measure the noise in what is left (n,) of a recording without its modes, four numbers each.

    By what the band holds. floor: least density.
    """
    density = np.maximum(
        _lower_half(left, sr, band_hz) * np.sqrt(len(left) / max(len(left) - 4 * modes, 0.1 * len(left))), floor
    )
    count = len(left) // FRAME
    frames = left[: count * FRAME].reshape(count, FRAME)
    power = power_spectrum(frames, positive_hann(FRAME))[:, 2:-2] / (3 / 8 * FRAME)
    here = np.interp(np.linspace(0, 1, FRAME // 2 + 1)[2:-2], np.linspace(0, 1, len(density)), density)
    freq = np.fft.rfftfreq(FRAME, 1 / sr)[2:-2]
    inside = (freq >= band_hz[0]) & (freq <= band_hz[1])
    use = inside if inside.any() else np.abs(freq - np.mean(band_hz)) < sr / FRAME
    course = mean_by_median((power / here**2)[:, use], 1)
    return Noise(density, np.maximum(course, 1e-3) if count else np.ones(1), sr)


def _lower_half(left: Array, sr: int, band_hz: tuple[float, float]) -> Array:
    """Return rms per sample (n_f,) over 0 … sr/2, from the lower half of the power in neighbourhoods that overlap."""
    power = _mirrored(power_spectrum(left) / len(left), sr, band_hz)
    width = min(max(26, len(power) // 60), len(power))
    side = np.pad(power, width // 2, mode="reflect")
    near = np.sort(np.lib.stride_tricks.sliding_window_view(side, width)[:: max(1, width // 8)], axis=1)
    r = width // 2
    mean = (near[:, :r].sum(axis=1) + (width - r) * near[:, r - 1]) / r
    at = np.arange(0, len(side) - width + 1, max(1, width // 8))
    # rumble is steep: below a neighbourhood's width one of two thirds of an octave to each side
    first = max(round(band_hz[0] / (sr / 2) * (len(power) - 1)), 1)
    low = np.unique(np.geomspace(max(first, 26), max(width, 27), 24).astype(int))
    steep = np.array([_lower_mean(power[int(c / 1.6) : int(c * 1.6) + 1]) for c in low if c < width])
    inside = at > width
    at, mean = np.concatenate([low[: len(steep)], at[inside]]), np.concatenate([steep, mean[inside]])
    return np.asarray(np.sqrt(np.interp(np.arange(len(power)), at, mean)))


def _lower_mean(power: Array) -> float:
    """Mean of exponentially distributed values (n,) by their lower half [Epstein & Sobel 1953]."""
    near, r = np.sort(power), max(len(power) // 2, 1)
    return float((near[:r].sum() + (len(near) - r) * near[r - 1]) / r)


def _mirrored(power: Array, sr: int, band_hz: tuple[float, float]) -> Array:
    """Return power (n_f,) over 0 … sr/2 with what the band holds mirrored at its edges in place of what it does not."""
    first, last = (round(min(f, sr / 2) / (sr / 2) * (len(power) - 1)) for f in band_hz)
    return np.pad(power[first : last + 1], (first, len(power) - 1 - last), mode="reflect")


def noise_density(signal: Array, sr: int, band_hz: tuple[float, float], *, tail: bool = False) -> Array:
    """Return rms per sample (n_f,) over frequency 0 … sr/2, as if white at that level, by what the band holds.

    tail: from the last third, else from all.
    """
    from scipy.ndimage import percentile_filter

    part = signal[-len(signal) // 3 :] if tail else signal
    window = np.hanning(len(part)) if tail else np.ones(len(part))
    power = _mirrored(power_spectrum(part, window) / (window**2).sum(), sr, band_hz)
    power = np.concatenate([power, power[-1:]]) if len(power) < 64 else power
    width = max(25, len(power) // 60)
    coarse = max(1, width // 50)
    trimmed = power[: len(power) // coarse * coarse].reshape(-1, coarse)
    smooth = (
        percentile_filter(trimmed.ravel(), 25, size=width, mode="nearest")
        if coarse == 1
        else percentile_filter(np.quantile(trimmed, 0.25, axis=1), 50, size=width // coarse, mode="nearest")
    )
    return np.asarray(np.sqrt(smooth / np.log(4 / 3)))


def matched(
    left: Array, noise: Noise, band_hz: tuple[float, float], needed: Callable[[Array], Array], fastest_per_s: float
) -> Array:
    """Return poles (k,), peaks whose matched filter on what is left (n,) answers with T > needed(Hz).

    T(ω, d) = 2|Σ x e^{−(d+iω)t}|² / (σ² Σ e^{−2dt}) [Kay 1998, eq. 7.29 with an exponential envelope], d in octaves:
    every resolution.
    """
    n, sr = len(left), noise.sr
    size = 1 << int(np.ceil(np.log2(2 * n)))
    freq = np.arange(size // 2 + 1) * sr / size
    sigma2 = noise.at(freq) ** 2
    time = np.arange(n) / sr
    decay = np.geomspace(0.5 * sr / n, 0.5 * fastest_per_s, 14)
    share = noise.share(decay)
    score = np.empty((len(decay), len(freq)))
    for i, d in enumerate(decay):
        fade = np.exp(-d * time)
        score[i] = 2 * power_spectrum(left, fade, size) / (sigma2 * (share[i] * float(fade @ fade)))
    score[:, (freq < band_hz[0]) | (freq > band_hz[1])] = 0
    best = score.max(axis=0)
    peak = local_peaks(best)
    peak = peak[best[peak] > needed(freq)[peak]]
    peak = peak[np.argsort(-best[peak], kind="stable")]
    pole = -decay[score[:, peak].argmax(axis=0)] + 2j * np.pi * freq[peak]
    chosen, count = np.empty_like(pole), 0
    for p in pole:
        others = chosen[:count]
        if (np.abs(p.imag - others.imag) > 4 * np.maximum(-p.real, -others.real)).all():
            chosen[count], count = p, count + 1
    return np.asarray(chosen[:count])
