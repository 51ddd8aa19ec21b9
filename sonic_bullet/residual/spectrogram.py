"""Power spectrograms with their axes, and the short-time transform they come from.

    S[m, k] = Σ_n w[n] x[mH + n - N/2] e^{-2πikn/N},  P = |S|²/(sr Σw²)        two-sided power per Hz: white noise of variance σ² has P = σ²/sr

w: Hann, periodic; H = N/4, so that Σ w² over frames is the same at every sample [Griffin & Lim 1984, eq. 6]. m frames, k bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from sonic_bullet.errors import AudioError
from sonic_bullet.records import Array, frozen_array

WINDOW = 512


@dataclass(frozen=True, slots=True, eq=False)
class Power:
    """Power per Hz (b, n) over freq_hz (b,) and time_s (n,), both ascending; between the points it is bilinear, above and after them zero."""

    freq_hz: Array
    time_s: Array
    per_hz: Array

    def __post_init__(self) -> None:
        for name, shape in (("freq_hz", (None,)), ("time_s", (None,)), ("per_hz", (len(self.freq_hz), len(self.time_s)))):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.float64, shape, f"power {name}"))
        if len(self.freq_hz) < 2 or len(self.time_s) < 2:
            raise AudioError("a spectrogram of fewer than two frames or bands", "give a longer recording")
        if (np.diff(self.freq_hz) <= 0).any() or (np.diff(self.time_s) <= 0).any() or (self.per_hz < 0).any():
            raise AudioError("a spectrogram whose axes do not ascend, or with a power below zero", "compute it anew")


@lru_cache(maxsize=8)
def hann(length: int) -> Array:
    """(length,) float32, periodic, read-only."""
    window = (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)).astype(np.float32)
    window.setflags(write=False)
    return window


def frame_count(n: int, window: int = WINDOW) -> int:
    """Frames that see any of n samples."""
    return (n + window // 2) // (window // 4) + 1


def axes(n: int, sr: int, window: int = WINDOW) -> tuple[Array, Array]:
    """Frequencies (window/2 + 1,) in Hz and times (m,) in s of `transform`."""
    return np.arange(window // 2 + 1) * sr / window, np.arange(frame_count(n, window)) * (window // 4) / sr


def transform(sample: Array, window: int = WINDOW) -> Array:
    """S (m, window/2 + 1) complex64 of samples (n,); frame m lies about sample m·window/4, zeros stand before and after."""
    n, hop = len(sample), window // 4
    frames = frame_count(n, window)
    padded = np.zeros((frames - 1) * hop + window, np.float32)
    padded[window // 2 : window // 2 + n] = sample
    return np.asarray(np.fft.rfft(np.lib.stride_tricks.sliding_window_view(padded, window)[::hop] * hann(window), axis=1))


def inverse(spectrum: Array, n: int, window: int = WINDOW) -> Array:
    """Samples (n,) float32 whose transform is nearest to S in squares [Griffin & Lim 1984, eq. 6]."""
    frames = np.fft.irfft(spectrum, window, axis=1)
    out = np.zeros((len(spectrum) - 1) * (window // 4) + window, np.float32)
    _overlap(frames.astype(np.float32, copy=False), hann(window) / np.float32(1.5), out)
    return out[window // 2 : window // 2 + n]


def power(sample: Array, sr: int, window: int = WINDOW) -> Power:
    """The power spectrogram of samples (n,) at sr Hz. Raises AudioError on nothing, NaN or a bad rate."""
    sample = checked(sample, sr)
    frequency, time = axes(len(sample), sr, window)
    return Power(frequency, time, (np.abs(transform(sample, window)) ** 2).T / (sr * float((hann(window).astype(float) ** 2).sum())))


def checked(sample: Array, sr: int) -> Array:
    """Samples (n,) as float64. Raises AudioError."""
    sample = np.asarray(sample, float)
    if sample.ndim != 1 or len(sample) == 0:
        raise AudioError(f"a clip of shape {sample.shape}", "give one channel that is not empty")
    if not np.isfinite(sample).all():
        raise AudioError("a clip that holds NaN or infinite samples", "repair the file")
    if not 0 < sr <= 10_000_000:
        raise AudioError(f"sample rate {sr}", "give a rate in Hz")
    return sample


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _overlap(frames: Array, window: Array, out: Array) -> None:  # pragma: no cover - compiled
    hop = len(window) // 4
    for m in range(len(frames)):
        for k in range(len(window)):
            out[m * hop + k] += frames[m, k] * window[k]
