"""Single modes out of a recording: each line shifted to 0 Hz, low-passed and decimated.

    z_k(t) = 2 (y e^{−iω_k t}) * w,   w a Hann window of length L, centred, sum 1:  nulls at ± 2/L and beyond   [Harris 1978, eq. 27]

Only lines that stand alone are worth it: no other of a twentieth of their strength nearer than 2/L.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonic_bullet.effects.values import Heard
from sonic_bullet.records import Array

WIDTH_HZ = (30.0, 400.0)
MOST_LINES = 30
FRAMES = 96
NEPERS = 8.0  # of a line's decay are looked at
SELF = 0.006  # relative: lines nearer than this may be one bent mode
CLEAR = 12.0  # of |z| over the noise in it


@dataclass(frozen=True, slots=True, eq=False)
class Envelopes:
    """z (s, q, t) complex of q lines at times time_s (q, t), each line its own; good (s, q, t) where it stands clear; line (q,): which of the heard.

    noise (s, q).
    """

    time_s: Array
    z: Array
    good: Array
    line: Array
    noise: Array


@lru_cache(maxsize=2)
def envelopes(h: Heard) -> Envelopes | None:
    """Of lines that stand alone and clear, spread over the frequencies; None where there are none."""
    if h.signal is None or not len(h.freq_hz):
        return None
    n, sr = h.signal.shape[1], h.sr
    picked, window = _alone(h, n, sr)
    if not picked:
        return None
    z = np.zeros((len(h.signal), len(picked), FRAMES), complex)
    good = np.zeros(z.shape, bool)
    noise = np.zeros(z.shape[:2])
    time = np.zeros((len(picked), FRAMES))
    floor = h.noise if len(h.noise) == len(h.signal) and np.isfinite(h.noise).all() else np.zeros(len(h.signal))
    for q, (k, length) in enumerate(zip(picked, window, strict=True)):
        turn = np.exp(-2j * np.pi * h.freq_hz[k] / sr * np.arange(n))
        shape = np.hanning(length + 2)[1:-1]
        shape /= shape.sum()
        spectrum = np.fft.fft(shape, _fast(n + length))
        last = min(n - length, int(NEPERS / max(h.decay_per_s[k], 1e-2) * sr) + length)
        at = np.unique(np.linspace(length // 2, max(last, length // 2 + FRAMES), FRAMES).astype(int))
        at = np.minimum(at, n - 1)
        time[q, : len(at)] = at / sr
        for s in range(len(h.signal)):
            whole = np.fft.ifft(np.fft.fft(h.signal[s] * turn, len(spectrum)) * spectrum)
            row = 2 * whole[np.minimum(at + (length - 1) // 2, len(whole) - 1)]  # centred: z(t) belongs to the time t
            z[s, q, : len(at)] = row
            noise[s, q] = 2 * floor[s] * np.sqrt((shape**2).sum())
            clear = np.abs(row) > CLEAR * max(noise[s, q], 1e-12)
            if not clear.all():  # nothing after the first dip: what comes back is something else
                clear[int(np.argmin(clear)) :] = False
            good[s, q, : len(at)] = clear
    return Envelopes(time, z, good, np.array(picked), noise)


def _alone(h: Heard, n: int, sr: int) -> tuple[list[int], list[int]]:
    """Lines with no strong neighbour, and the window for each; every so many of them, from low to high."""
    every = np.concatenate([h.freq_hz, h.foreign_hz])
    strength = np.concatenate([np.abs(h.amplitude).max(axis=0), np.abs(h.foreign_amplitude).max(axis=0)])
    picked, window = [], []
    for k in range(len(h.freq_hz)):
        rival = np.abs(every - h.freq_hz[k])
        near = (rival > 1e-9) & (strength > 0.05 * strength[k]) & (rival > SELF * h.freq_hz[k])
        same = (rival < SELF * h.freq_hz[k]) & (strength > 3 * strength[k])  # the louder one of a bent mode's lines stands for it
        gap = rival[near].min() if near.any() else np.inf
        width = min(0.8 * gap, WIDTH_HZ[1])
        if width >= max(WIDTH_HZ[0], 0.6 * h.decay_per_s[k]) and not same.any() and int(2 * sr / width) < n // 4:
            picked.append(k)
            window.append(int(2 * sr / width) | 1)
    if len(picked) > MOST_LINES:
        keep = np.unique(np.linspace(0, len(picked) - 1, MOST_LINES).astype(int))
        picked, window = [picked[i] for i in keep], [window[i] for i in keep]
    return picked, window


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
