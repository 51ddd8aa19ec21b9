"""What a line is of itself, and what a diffuse tail makes of it: its own decay, amplitude and frequency, read through a reverberation of the rate δ.

    z(t) = A (e^{pt} + r(t)),  p = −d + iΔω;   dr = p r dt + noise of power w² 2δ e^{−2δt}: what the tail's taps drive the mode with   [Polack 1988; Kuttruff 2009, ch. 4]
    Cov(r(t), r(t')) = w² 2δ e^{−d|t − t'|} (e^{−2δm} − e^{−2dm})/(2d − 2δ),   m = min(t, t')              [Ornstein & Uhlenbeck 1930, with fading noise]
    ln L = −ln det V − |z − A e^{pt}|² in V⁻¹,   V = |A|² w² C + noise;  A in closed form, d and w summed over grids, Δω at its best

z is the line's baseband over all strikes at once, in short frames: weighted with the model's pattern, so that what is near in frequency and not alike cancels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.effects.ringing import sounded
from sonic_bullet.effects.values import Blow, Heard, Ring
from sonic_bullet.records import Array

FRAME_S = 0.012
DENSE, FRAMES = 24, 56  # frames one after another, then ever farther apart
NODES = 8  # of a window's quadrature
DECAYS = np.geomspace(2.0, 600.0, 25)
SHARES = np.geomspace(1e-3, 4.0, 10)  # |A|² w² over what the first frame suggests |A|² to be
SHIFTS = 25
PATTERN = 0.03  # of a line's strongest: what shapes are wrong by
SURE = 0.1  # of a decay and of an amplitude: the tail's early echoes are no noise


@dataclass(frozen=True, slots=True, eq=False)
class Read:
    """k lines at each δ of t: ln_likelihood, decay_per_s and its ln_sd, shift_hz, amplitude (over the model's so far) with amplitude_sd, wet: all (t, k).

    plain (k,): ln likelihood of the line without a tail, at the same decays.
    """

    delta: Array
    ln_likelihood: Array
    plain: Array
    decay_per_s: Array
    ln_sd: Array
    shift_hz: Array
    amplitude: Array
    amplitude_sd: Array
    wet: Array


def read(h: Heard, delta: Array, lines: Array) -> Read:
    """Some of an object's lines (k,), by index, at some δ (t,)."""
    assert h.signal is not None
    start, window = _frames(h)
    z, noise = _basebands(h, lines, start, window)
    time = start / h.sr
    same = _overlap(start, window)
    value, vector = np.linalg.eigh(same)
    white = (vector / np.sqrt(value)) @ vector.T
    node = (np.arange(NODES) + 0.5) / NODES * FRAME_S
    weight = np.hanning(NODES + 2)[1:-1]
    rows = [[_at(z, noise, time, node, weight / weight.sum(), white, d, float(one), h.sr) for d in DECAYS] for one in delta]
    return _summed(delta, rows)


def dried(h: Heard, delta: float) -> Heard:
    """The same with frequencies, decays and amplitudes of the lines as they would be without the tail. No value for lines it has buried."""
    lines = np.arange(len(h.freq_hz))
    if h.dry or h.signal is None or not len(lines):
        return h
    r = read(h, np.array([delta]), lines)
    decay, sd = r.decay_per_s[0], np.hypot(r.ln_sd[0], SURE) * r.decay_per_s[0]
    told = _own(h, lines)
    now = (np.conj(told) * h.amplitude).sum(axis=0) / (np.abs(told) ** 2).sum(axis=0)
    factor = r.amplitude[0] / np.where(now == 0, 1, now)
    spread = np.hypot(h.amplitude_sd * np.abs(factor), np.abs(told) * np.hypot(r.amplitude_sd[0], SURE * np.abs(r.amplitude[0])))
    return replace(
        h,
        freq_hz=h.freq_hz + r.shift_hz[0],
        decay_per_s=decay,
        freq_sd_hz=np.hypot(h.freq_sd_hz, decay / (2 * np.pi) * r.ln_sd[0]),
        decay_sd_per_s=sd,
        amplitude=h.amplitude * factor,
        amplitude_sd=spread,
        dry=True,
    )


def direct(h: Heard, delta: float) -> Array:
    """What the strikes (s, n) would sound like without the tail: the lines' modes as they are read, the others as the nearest of those."""
    assert h.signal is not None
    lines = np.arange(len(h.freq_hz))
    r = read(h, np.array([delta]), lines)
    near = np.abs(np.log(h.all_hz[:, None] / h.freq_hz)).argmin(axis=1)
    shift = np.zeros(len(h.all_hz))
    for k, members in enumerate(h.mode):
        near[members], shift[members] = k, h.freq_hz[k] + r.shift_hz[0, k] - h.all_hz[members]
    none = np.zeros(len(near))
    once = Blow(1.0, np.zeros(1), np.ones(1))
    rings = (Ring(h.all_hz + shift, r.decay_per_s[0, near], row * r.amplitude[0, near], none, none, none) for row in h.push)
    return np.stack([sounded(ring, once, h.signal.shape[1], h.sr) for ring in rings])


def _frames(h: Heard) -> tuple[Array, Array]:
    """First samples (n,) of the frames, and their window."""
    assert h.signal is not None
    window = np.hanning(round(FRAME_S * h.sr) + 2)[1:-1]
    hop = len(window) // 2
    last = max((h.signal.shape[1] - len(window)) // hop, 1)
    dense = np.arange(min(DENSE, last))
    sparse = np.geomspace(DENSE, last, FRAMES - DENSE).round().astype(int) if last > DENSE else dense[:0]
    return hop * np.unique(np.concatenate([dense, sparse])), window / window.sum()


def _own(h: Heard, lines: Array) -> Array:
    """What the model so far says of the lines (s, k), complex."""
    return np.stack([h.push[:, h.mode[k]].sum(axis=1) for k in lines], axis=1)


def _basebands(h: Heard, lines: Array, start: Array, window: Array) -> tuple[Array, Array]:
    """Frames (k, n) of every line in units of the model's own amplitude, and the noise's variance there (k,)."""
    assert h.signal is not None
    at = np.arange(len(window)) / h.sr
    piece = h.signal[:, start[:, None] + np.arange(len(window))] * window
    freq = h.freq_hz[lines]
    spectrum = 2 * np.einsum("snt,tk->ksn", piece, np.exp(-2j * np.pi * np.outer(at, freq)), optimize=True)
    spectrum *= np.exp(-2j * np.pi * freq[:, None] * start / h.sr)[:, None, :]
    own = _own(h, lines)
    mixed, noise = [], []
    level = np.broadcast_to(h.noise, (h.signal.shape[0],))
    for i, k in enumerate(lines):
        other = np.setdiff1d(np.flatnonzero(np.abs(h.all_hz - freq[i]) < 2 / FRAME_S), h.mode[k])
        through = np.abs(window @ np.exp(2j * np.pi * np.outer(at, h.all_hz[other] - freq[i])))
        near = h.push[:, other] * through
        size = float(np.linalg.norm(own[:, i]))
        spread = near @ near.conj().T + (PATTERN * size) ** 2 * np.eye(len(own)) + 1e-300 * np.eye(len(own))
        row = np.linalg.solve(spread, own[:, i]).conj()
        row = row / (row @ own[:, i]) if size else np.zeros(len(own))
        mixed.append(row @ spectrum[i])
        noise.append(4 * (np.abs(row) ** 2 * level**2).sum() * (window**2).sum())
    return np.array(mixed), np.maximum(np.array(noise), 1e-300)


def _overlap(start: Array, window: Array) -> Array:
    """Correlation (n, n) of white noise in two frames."""
    whole = np.correlate(window, window, "full")
    lag = np.abs(start[:, None] - start[None, :])
    mine = np.where(lag < len(window), whole[np.minimum(lag, len(window) - 1) + len(window) - 1], 0.0)
    return np.asarray(mine / whole[len(window) - 1])


def _tail(time: Array, node: Array, weight: Array, decay: float, delta: float) -> tuple[Array, Array]:
    """Frames (n,) of e^{−dt}, and the covariance (n, n) of a tail's of unit wet."""
    t = (time[:, None] + node).ravel()
    gap = 2 * (decay - delta)
    gap = gap if abs(gap) > 1e-3 else 1e-3
    var = 2 * delta * (np.exp(-2 * delta * t) - np.exp(-2 * decay * t)) / gap
    early = np.minimum(np.arange(len(t))[:, None], np.arange(len(t))[None, :])
    early = np.where(t[:, None] < t[None, :], np.arange(len(t))[:, None], np.arange(len(t))[None, :])
    both = np.exp(-decay * np.abs(t[:, None] - t[None, :])) * var[early]
    both = (both.reshape(len(time), len(node), len(time), len(node)) * weight[:, None, None] * weight).sum(axis=(1, 3))
    return np.exp(-decay * (time[:, None] + node)) @ weight, both


def _at(z: Array, noise: Array, time: Array, node: Array, weight: Array, white: Array, decay: float, delta: float, sr: int) -> tuple[Array, ...]:
    """For every line: ln likelihood (k, w), A, its sd, Δf at its best and w, each (k, w), at one decay and one δ."""
    mean, both = _tail(time, node, weight, decay, delta)
    value, vector = np.linalg.eigh(white @ both @ white)
    turn = vector.T @ white
    half = min(max(2 * max(decay, delta) / np.pi, 2.0), 0.4 / (time[1] - time[0]))
    shift = np.linspace(-half, half, SHIFTS)
    moved = z[:, :, None] * np.exp(-2j * np.pi * time[:, None] * shift)
    b, m = turn @ moved, turn @ mean  # (k, n, Δ), (n,)
    first = np.abs(z[:, 0] / mean[0]) ** 2
    scale = first[:, None] * SHARES  # (k, w): |A|² w²
    over = 1 / (scale[:, :, None] * np.maximum(value, 0) + noise[:, None, None])  # (k, w, n)
    power, cross, size = over @ np.abs(b) ** 2, (over * m) @ b, over @ m**2  # (k, w, Δ), (k, w, Δ), (k, w)
    best = (power - np.abs(cross) ** 2 / size[:, :, None]).argmin(axis=2)
    pick = np.take_along_axis(cross, best[:, :, None], axis=2)[:, :, 0]
    left = np.take_along_axis(power, best[:, :, None], axis=2)[:, :, 0] - np.abs(pick) ** 2 / size
    amplitude = pick / size
    wet = np.sqrt(scale) / np.maximum(np.abs(amplitude), 1e-300)
    return -left + np.log(over).sum(axis=2), amplitude, 1 / np.sqrt(size), shift[best], wet


def _summed(delta: Array, rows: list[list[tuple[Array, ...]]]) -> Read:
    """Over decays and wets: means of ln d, the rest at the likeliest."""
    like, amplitude, sd, shift, wet = (np.array([[one[i] for one in row] for row in rows]) for i in range(5))  # (t, d, k, w)
    t, _, k, _ = like.shape
    top = like.max(axis=(1, 3), keepdims=True)
    share = np.exp(like - top)
    by_decay = share.sum(axis=3)
    total = by_decay.sum(axis=1)
    mean = np.einsum("tdk,d->tk", by_decay, np.log(DECAYS)) / total
    square = np.einsum("tdk,d->tk", by_decay, np.log(DECAYS) ** 2) / total
    flat = like.transpose(0, 2, 1, 3).reshape(t, k, -1)
    best = flat.argmax(axis=2)[:, :, None]
    at = [np.take_along_axis(x.transpose(0, 2, 1, 3).reshape(t, k, -1), best, axis=2)[:, :, 0] for x in (amplitude, sd, shift, wet)]
    plain = like[:, :, :, 0].max(axis=(0, 1))
    step = np.log(DECAYS[1] / DECAYS[0])
    ln_sd = np.sqrt(np.maximum(square - mean**2, 0) + step**2 / 12)
    return Read(delta, top[:, 0, :, 0] + np.log(total), plain, np.exp(mean), ln_sd, at[2], at[0], at[1], at[3])
