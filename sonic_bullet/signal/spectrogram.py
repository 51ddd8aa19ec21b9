"""Power spectrograms with their axes, and the short-time transform they come from.

    S[m, k] = Σ_n w[n] x[mH + n - N/2] e^{-2πikn/N},  P = |S|²/(sr Σw²)
        two-sided power per Hz: white noise of variance σ² has P = σ²/sr
    x[n] = Σ_m w[n - mH] x_m[n - mH] / Σ_m w²[n - mH]                         nearest in squares
        [Griffin & Lim 1984, eq. 6]

w: Hann, periodic; H = N/4 for analysis, N/2 for synthesis: phases then converge sooner. m frames, k bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonic_bullet._engine import add_frames, cut_frames
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.elementary import cos

RESIDUAL_WINDOW = 512


@dataclass(frozen=True, slots=True, eq=False)
class Power:
    """Power per Hz (b, n) over freq_hz (b,) and time_s (n,), both ascending.

    Bilinear between the points, zero above and after them.
    """

    freq_hz: Array
    time_s: Array
    per_hz: Array

    def __post_init__(self) -> None:
        """Check shapes, axes and signs."""
        for name, shape in (
            ("freq_hz", (None,)),
            ("time_s", (None,)),
            ("per_hz", (len(self.freq_hz), len(self.time_s))),
        ):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.float64, shape, f"power {name}"))
        if len(self.freq_hz) < 2 or len(self.time_s) < 2:
            raise AudioError("a spectrogram of fewer than two frames or bands", "give a longer recording")
        if (np.diff(self.freq_hz) <= 0).any() or (np.diff(self.time_s) <= 0).any() or (self.per_hz < 0).any():
            raise AudioError("a spectrogram whose axes do not ascend, or with a power below zero", "compute it anew")


@lru_cache(maxsize=8)
def hann(length: int) -> Array:
    """Return the Hann window (length,) float32, periodic, read-only."""
    window = (0.5 - 0.5 * cos(2 * np.pi * np.arange(length) / length)).astype(np.float32)
    window.setflags(write=False)
    return window


def frame_count(n: int, window: int = RESIDUAL_WINDOW, overlap: int = 4) -> int:
    """Count the frames that contain any of n samples, window/overlap apart."""
    return (n + window // 2) // (window // overlap) + 1


def axes(n: int, sr: int, window: int = RESIDUAL_WINDOW, overlap: int = 4) -> tuple[Array, Array]:
    """Return frequencies (window/2 + 1,) in Hz and times (m,) in s of `transform`."""
    return np.arange(window // 2 + 1) * sr / window, np.arange(frame_count(n, window, overlap)) * (
        window // overlap
    ) / sr


def transform(sample: Array, window: int = RESIDUAL_WINDOW, overlap: int = 4) -> Array:
    """Compute S (m, window/2 + 1) complex64 of samples (n,).

    Frame m is centred on sample m·window/overlap, with zeros before and after the samples.
    """
    from scipy.fft import rfft  # transforms several frames at once in vector registers, unlike numpy

    frames = np.empty((frame_count(len(sample), window, overlap), window), np.float32)
    cut_frames(np.ascontiguousarray(sample, np.float32), hann(window), window // overlap, frames)
    return np.asarray(rfft(frames, axis=1, overwrite_x=True))


def inverse(spectrum: Array, n: int, window: int = RESIDUAL_WINDOW, overlap: int = 4) -> Array:
    """Compute the samples (n,) float32 whose transform is nearest to S in squares."""
    from scipy.fft import irfft

    out = np.zeros(n, np.float32)
    add_frames(irfft(spectrum, window, axis=1), _synthesis(window, overlap), window // overlap, out)
    edge = _edge(window, overlap)[:n]
    out[: len(edge)] *= edge
    return out


@lru_cache(maxsize=8)
def _edge(window: int, overlap: int) -> Array:
    """Compute factors (window/2,) of the first samples, which no frame centred before them covers."""
    hop, square = window // overlap, np.concatenate([np.zeros(window), hann(window).astype(float) ** 2])
    at = window + window // 2 + np.arange(window // 2)
    seen = np.sum([square[at - m * hop] for m in range(overlap)], axis=0)
    whole = np.tile(square[window:].reshape(overlap, hop).sum(axis=0), overlap)[: window // 2]
    return np.asarray((whole / seen).astype(np.float32))


@lru_cache(maxsize=8)
def _synthesis(window: int, overlap: int) -> Array:
    """Compute w/Σ w² over frames (window,), as it is in the middle of a sound."""
    shape = hann(window).astype(float)
    made = (shape / np.tile((shape**2).reshape(overlap, window // overlap).sum(axis=0), overlap)).astype(np.float32)
    made.setflags(write=False)
    return np.asarray(made)


def power(sample: Array, sr: int, window: int = RESIDUAL_WINDOW) -> Power:
    """Compute the power spectrogram of samples (n,) at sr Hz. Raises AudioError on nothing, NaN or a bad rate."""
    sample = check_samples(sample, sr)
    frequency, time = axes(len(sample), sr, window)
    return Power(
        frequency,
        time,
        (np.abs(transform(sample, window)) ** 2).T / (sr * float((hann(window).astype(float) ** 2).sum())),
    )


def check_samples(sample: Array, sr: int) -> Array:
    """Check samples (n,) and return them as float64. Raises AudioError."""
    sample = np.asarray(sample, float)
    if sample.ndim != 1 or len(sample) == 0:
        raise AudioError(f"a clip of shape {sample.shape}", "give one channel that is not empty")
    if not np.isfinite(sample).all():
        raise AudioError("a clip that holds NaN or infinite samples", "repair the file")
    if not 0 < sr <= 10_000_000:
        raise AudioError(f"sample rate {sr}", "give a rate in Hz")
    return sample
