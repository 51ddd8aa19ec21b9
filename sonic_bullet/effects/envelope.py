"""Single modes out of a recording: each line shifted to 0 Hz, low-passed and decimated.

    z_k(t) = 2 (y e^{−iω_k t}) * w,   w a Hann window of length L, centred, sum 1:  nulls at ± 2/L and beyond   [Harris 1978, eq. 27]

Only lines that stand alone are worth it: no other of a twentieth of their strength nearer than 2/L.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.effects.values import Heard
from sonic_bullet.records import Array

WIDTH_HZ = (30.0, 400.0)
MOST_LINES = 24
CLEAR = 12.0  # of |z| over the noise in it


@dataclass(frozen=True, slots=True, eq=False)
class Envelopes:
    """z (s, q, t) complex of q lines at times time_s (t,), each line its own: good (s, q, t) where it stands clear; line (q,): which of the heard; noise (s, q)."""

    time_s: Array
    z: Array
    good: Array
    line: Array
    noise: Array


def envelopes(h: Heard, *, frames: int = 160) -> Envelopes | None:
    """Of the strongest lines that stand alone; None where there are none."""
    if h.signal is None or not len(h.freq_hz):
        return None
    every = np.concatenate([h.freq_hz, h.foreign_hz])
    strength = np.concatenate([np.abs(h.amplitude).max(axis=0), np.abs(h.foreign_amplitude).max(axis=0)])
    n, sr = h.signal.shape[1], h.sr
    picked, window = [], []
    for k in np.argsort(-strength[: len(h.freq_hz)]):
        rival = np.abs(every - h.freq_hz[k])
        near = (rival > 1e-9) & (strength > 0.05 * strength[k]) & (rival > 0.012 * h.freq_hz[k])  # nearer ones may be the mode itself, bent
        gap = rival[near].min() if near.any() else np.inf
        width = min(0.8 * gap, WIDTH_HZ[1])
        if width >= max(WIDTH_HZ[0], 0.6 * h.decay_per_s[k]):
            picked.append(int(k))
            window.append(int(2 * sr / width) | 1)
        if len(picked) == MOST_LINES:
            break
    if not picked:
        return None
    step = max(1, n // (4 * frames))
    at = np.arange(0, n // 2, step)[: 2 * frames]
    z = np.zeros((len(h.signal), len(picked), len(at)), complex)
    good = np.zeros(z.shape, bool)
    noise = np.zeros(z.shape[:2])
    for q, (k, length) in enumerate(zip(picked, window, strict=True)):
        turn = np.exp(-2j * np.pi * h.freq_hz[k] / sr * np.arange(n))
        shape = np.hanning(length + 2)[1:-1]
        shape /= shape.sum()
        spectrum = np.fft.fft(shape, _fast(n + length))
        for s in range(len(h.signal)):
            whole = np.fft.ifft(np.fft.fft(h.signal[s] * turn, len(spectrum)) * spectrum)
            centre = at + (length - 1) // 2  # of the window, so that z(t) belongs to the time t
            z[s, q] = 2 * whole[np.minimum(centre, len(whole) - 1)]
            noise[s, q] = 2 * h.noise[min(s, len(h.noise) - 1)] * np.sqrt((shape**2).sum()) if np.isfinite(h.noise).all() else 0.0
            inside = (at >= length // 2) & (at < n - length // 2)
            good[s, q] = inside & (np.abs(z[s, q]) > CLEAR * max(noise[s, q], 1e-12))
            if good[s, q].any():  # nothing after the first dip: what comes back is something else
                first_bad = np.flatnonzero(inside & ~good[s, q])
                if len(first_bad):
                    good[s, q, first_bad[0] :] = False
    return Envelopes(at / sr, z, good, np.array(picked), noise)


def _fast(n: int) -> int:
    from scipy.fft import next_fast_len

    return int(next_fast_len(n))


def levels(h: Heard) -> dict[str, Array]:
    """How hard each line (s, k) is driven, by three measures: the impulse, peak velocity and peak displacement at the body's surface."""
    level = np.where(np.isfinite(h.impulse_n_s), h.impulse_n_s, 1.0)
    found = {"impulse": np.repeat(level[:, None], len(h.freq_hz), axis=1)}
    if h.model is None:
        return found
    body = np.unique(h.model.face)
    most = np.sqrt((h.model.shape[body].astype(float) ** 2).sum(axis=1)).max(axis=0)
    push = np.abs(np.einsum("sxm,sx->sm", h.model.shape[h.strike_vertex].astype(float), h.strike_way)) * most
    velocity = level[:, None] * np.stack([push[:, m].max(axis=1) for m in h.mode], axis=1)
    return found | {"velocity": velocity, "displacement": velocity / (2 * np.pi * h.freq_hz)}
