"""Residuals made by hand: noise whose level and decay each neighbourhood of modes has for itself, and lines."""

from __future__ import annotations

import numpy as np

from sonic_bullet.engine.residual.transfer import StruckModes
from sonic_bullet.records import Residual
from sonic_bullet.signal.spectrogram import Power

SR = 48_000


def modes(freq_hz: object, decay_per_s: object = 20.0, amplitude: object = 1.0) -> StruckModes:
    freq = np.asarray(freq_hz, float)
    return StruckModes(
        freq,
        np.broadcast_to(np.asarray(decay_per_s, float), freq.shape),
        np.broadcast_to(np.asarray(amplitude, float), freq.shape),
    )


def residual(
    source: StruckModes,
    *,
    per_hz: float = 1e-7,
    decay_per_s: float = 10.0,
    last_s: float = 0.5,
    lines: tuple[tuple[float, float, float], ...] = (),
) -> Residual:
    """Noise of one level over the whole band, falling as e^(-2dt), beside the modes; lines of (Hz, 1/s, amplitude)."""
    freq, time = np.linspace(0, 24_000, 200), np.linspace(0, last_s, 100)
    power = per_hz * np.exp(-2 * decay_per_s * time)[None] * np.ones((200, 1))
    columns = np.array(lines, float).reshape(-1, 3).T
    return Residual(source.freq_hz, source.decay_per_s, source.amplitude, *columns, freq, time, power, 1.0, "made")


def banded(centre_hz: float, width_hz: float, decay_per_s: float, last_s: float = 0.5) -> Power:
    """A band of noise that falls as e^(-2dt)."""
    freq, time = np.linspace(0, 24_000, 2401), np.linspace(0, last_s, 200)
    return Power(
        freq, time, np.exp(-(((freq - centre_hz) / width_hz) ** 2))[:, None] * np.exp(-2 * decay_per_s * time)[None]
    )
