"""Single modes of a recording: each line shifted to 0 Hz, low-passed and decimated.

    z_k(t) = 2 (y e^{−iω_k t}) * w,   w a Hann window of length L, centred, sum 1:  nulls at ± 2/L and beyond
        [Harris 1978, eq. 27]

The window is a sum of three exponentials, 1/(L + 1) Σ_a c_a e^{iaθ(n − m)}, θ = 2π/(L + 1), c = ½, 1, ½: z at any
sample m is a difference of running sums.

Only isolated lines are used: no other of a twentieth of their strength nearer than 2/L, but for their own first, short
part, which the window has to hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sonic_bullet._engine import sum_baseband
from sonic_bullet.geometry import label_components
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import positive_hann

# of a frequency; of a decay: a line that near and that short is what a mode was before its frequency had drifted
# down, or up
DRIFT_REACH = 0.15
DRIFT_DECAY_RATIO = 5.0
CLEAR_OF_NOISE = 12.0  # of |z| over the noise in it


@dataclass(frozen=True, slots=True, eq=False)
class Envelopes:
    """Basebands of q lines at t times, each line its own times.

    Attributes
    ----------
    time_s : (q, t)
        Times of the frames.
    z : (s, q, t) complex
        Basebands.
    good : (s, q, t) bool
        Frames that are well above the noise.
    line : (q,)
        Indices among the observed lines.
    noise : (s, q)
        Rms of the noise in z.
    phase : (s, q, t)
        Of z, without jumps, however few the frames are.
    window_s : (q,)
        Lengths L of the windows.
    """

    time_s: Array
    z: Array
    good: Array
    line: Array
    noise: Array
    phase: Array
    window_s: Array

    def worth(self, s: int, q: int) -> Array:
        """Compute the weight of each frame (t,) of a line: its level over the noise, squared, at most most_said."""
        most_said = 1e4  # by one frame
        return np.asarray(np.minimum((np.abs(self.z[s, q]) / max(self.noise[s, q], 1e-12)) ** 2, most_said))


@lru_cache(maxsize=2)
def envelopes(h: ObjectEvidence) -> Envelopes | None:
    """Compute the envelopes of isolated lines, spread over the frequencies; None where there are none."""
    if h.signal is None or not len(h.freq_hz):
        return None
    selected, window = alone(h)
    return extract_envelopes(h, h.signal if h.own is None else h.own, selected, window) if selected else None


def extract_envelopes(h: ObjectEvidence, signal: Array, selected: list[int], window: list[int]) -> Envelopes:
    """Compute the envelopes of lines that `alone` selected.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    signal : (s, n)
        Its recordings, or a synthesis in their place.
    selected : list of int
        The lines.
    window : list of int
        Length of each line's window in samples, odd.
    """
    frames = 96
    nepers = 8.0  # of a line's decay are looked at
    n, sr = signal.shape[1], h.sr
    z = np.zeros((len(signal), len(selected), frames), complex)
    good = np.zeros(z.shape, bool)
    phase = np.zeros(z.shape)
    noise = np.zeros(z.shape[:2])
    time = np.zeros((len(selected), frames))
    known = len(h.noise) == len(signal) and np.isfinite(h.noise).all()
    floor = h.noise_at(h.freq_hz[selected]) if known else np.zeros((len(signal), len(selected)))
    for q, (k, length) in enumerate(zip(selected, window, strict=True)):
        shape = positive_hann(length)
        shape /= shape.sum()
        last = min(n - length, int(nepers / max(h.decay_per_s[k], 1e-2) * sr) + length)
        at = np.unique(np.linspace(length // 2, max(last, length // 2 + frames), frames).astype(int))
        at = np.minimum(at, n - 1)
        time[q, : len(at)] = at / sr
        dense = np.arange(at[0], at[-1] + 1, max(length // 8, 1))
        for s in range(len(signal)):
            whole = window_signal(signal[s], 2 * np.pi * h.freq_hz[k] / sr, length, np.concatenate([at, dense]))
            row, between = whole[: len(at)], whole[len(at) :]  # centred: z(t) belongs to the time t
            z[s, q, : len(at)] = row
            angle = np.interp(at, dense, np.unwrap(np.angle(between)))
            phase[s, q, : len(at)] = angle + (np.angle(row) - angle + np.pi) % (2 * np.pi) - np.pi
            noise[s, q] = 2 * floor[s, q] * np.sqrt((shape**2).sum())
            clear = np.abs(row) > CLEAR_OF_NOISE * max(noise[s, q], 1e-12)
            if not clear.all():  # nothing after the first dip: what comes back is something else
                clear[int(np.argmin(clear)) :] = False
            good[s, q, : len(at)] = clear
    return Envelopes(time, z, good, np.array(selected), noise, phase, np.array(window) / sr)


def window_signal(y: Array, omega: float, length: int, at: Array) -> Array:
    """Compute z of a recording at some samples; beyond its ends it is zero.

    Parameters
    ----------
    y : (n,)
        The recording.
    omega : float
        Frequency of the line in rad a sample.
    length : int
        Length of the window in samples, odd.
    at : (t,)
        Samples on which the window is centred.
    """
    half, theta = length // 2, 2 * np.pi / (length + 1)
    first, last = np.clip(at - half, 0, len(y)), np.clip(at + half + 1, 0, len(y))
    audible = np.ascontiguousarray(y, float)[: int(last.max(initial=0))]
    run = np.empty((3, len(audible) + 1), complex)
    sum_baseband(audible, omega, theta, run)
    part = run[:, last] - run[:, first]
    around = np.exp(1j * theta * at)
    return np.asarray(2 / (length + 1) * (part[1] + 0.5 * (part[0] * around + part[2] / around)))


def alone(h: ObjectEvidence) -> tuple[list[int], list[int]]:
    """Select lines without a strong neighbour, and a window for each; at most most_lines, from low to high."""
    width_hz = (30.0, 400.0)
    most_lines = 30
    self = 0.006  # relative: lines nearer than this may be one bent mode
    if h.signal is None:
        return [], []
    n, sr = h.signal.shape[1], h.sr
    every, decay = h.every_hz, np.nan_to_num(h.every_decay_per_s)
    strength = np.abs(h.every_amplitude).max(axis=0)
    chain, foreign = _chains(every, decay), np.arange(len(every)) >= len(h.freq_hz)
    selected, window = [], []
    for k in range(len(h.freq_hz)):
        rival = np.abs(every - h.freq_hz[k])
        # its own beginning, while it was loud
        pitch_fall = (chain == chain[k]) & foreign | (rival < DRIFT_REACH * h.freq_hz[k]) & (
            decay > DRIFT_DECAY_RATIO * decay[k]
        )
        near = (rival > 1e-9) & (strength > 0.05 * strength[k]) & (rival > self * h.freq_hz[k]) & ~pitch_fall
        # the louder one of a bent mode's lines stands for it
        same = (rival < self * h.freq_hz[k]) & (strength > 3 * strength[k]) & ~pitch_fall
        gap = rival[near].min() if near.any() else np.inf
        width = min(
            0.8 * gap, max([width_hz[1], *(2 * rival + decay / np.pi)[pitch_fall & (strength > 0.05 * strength[k])]])
        )
        if width >= max(width_hz[0], 0.6 * h.decay_per_s[k]) and not same.any() and int(2 * sr / width) < n // 4:
            selected.append(k)
            window.append(int(2 * sr / width) | 1)
    if len(selected) > most_lines:
        keep = np.unique(np.linspace(0, len(selected) - 1, most_lines).astype(int))
        selected, window = [selected[i] for i in keep], [window[i] for i in keep]
    return selected, window


def _chains(freq_hz: Array, decay_per_s: Array) -> Array:
    """Assign lines (k,) to chains: lines so near each other, for their decays, that one drifting mode may be all."""
    link = 4.0  # of the shorter line's decay: how far in ω two lines of a chain are
    slow, fast = np.minimum.outer(decay_per_s, decay_per_s), np.maximum.outer(decay_per_s, decay_per_s)
    gap = np.abs(np.subtract.outer(freq_hz, freq_hz))
    linked = (2 * np.pi * gap < link * fast) & (fast < DRIFT_DECAY_RATIO * slow) & (gap < DRIFT_REACH * freq_hz)
    return label_components(len(freq_hz), *np.nonzero(linked))


def levels(h: ObjectEvidence) -> dict[str, Array]:
    """Compute the level of each line (s, k) by three measures.

    Returns
    -------
    dict of (s, k)
        The impulse that the pulse leaves of the impact, peak velocity and peak displacement at the body's surface.
    """
    level = h.level_n_s
    found = {"impulse": level[:, None] * np.stack([h.pressed[:, m].max(axis=1) for m in h.mode], axis=1)}
    if h.model is None:
        return found
    body = np.unique(h.model.face)
    most = np.sqrt((h.model.shape[body].astype(float) ** 2).sum(axis=1)).max(axis=0)
    push = (
        np.abs(np.einsum("sxm,sx->sm", h.model.shape[h.strike_vertex].astype(float), h.strike_direction))
        * most
        * h.pressed
    )
    velocity = level[:, None] * np.stack([push[:, m].max(axis=1) for m in h.mode], axis=1)
    return found | {"velocity": velocity, "displacement": velocity / (2 * np.pi * h.freq_hz)}


def falls(e: Envelopes, q: int, fitted: float) -> float:
    """Compute the decay of a line's own level in 1/s.

    A linear fit represents a mode of drifting frequency by several lines, none with its decay.

    Parameters
    ----------
    e : Envelopes
        Envelopes of the object's lines.
    q : int
        Index of the line among them.
    fitted : float
        Decay by a linear fit, returned where too few frames are clear.
    """
    held = 0.8  # of 2/L to both sides, at most: what the window holds of a drifting frequency
    rows = []
    for s in range(len(e.z)):
        use = e.good[s, q]
        if use.sum() < 8:
            continue
        t, size = e.time_s[q, use], np.abs(e.z[s, q, use])
        off = np.gradient(e.phase[s, q, use], t) / (2 * np.pi) * e.window_s[q]
        w = e.worth(s, q)[use] * (np.abs(off) < held)
        if (w > 0).sum() < 8:
            continue
        off = np.clip(off, -held, held)
        # while its frequency drifts, it is observed through the window's skirt
        rows.append((t, np.log(size * (1 - off**2) / np.sinc(off)), w))
    return max(common_fall(rows, fitted), 1e-3)


def common_fall(rows: list[tuple[Array, Array, Array]], unknown: float) -> float:
    """Fit one rate in 1/s to the fall of ln levels, each strike's from a level of its own, by weighted least squares.

    Parameters
    ----------
    rows : list of ((n,), (n,), (n,))
        Times in s, ln levels and weights, a strike each.
    unknown : float
        Returned where no times differ.
    """
    top = bottom = 0.0
    for t, level, w in rows:
        since = t - np.average(t, weights=w)
        top, bottom = top - float((w * since * level).sum()), bottom + float((w * since * since).sum())
    return top / bottom if bottom > 0 else unknown
