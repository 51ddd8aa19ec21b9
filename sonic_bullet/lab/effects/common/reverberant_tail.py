"""Lines in a reverberation of the rate δ: a line's own decay, amplitude and frequency, separated from the diffuse tail.

    z(t) = A (e^{pt} + r(t)),  p = −d + iΔω;   dr = p r dt + noise of power w² 2δ e^{−2δt}: the tail's excitation of the
        mode     [Polack 1988; Kuttruff 2009, ch. 4]
    Cov(r(t), r(t')) = w² 2δ e^{−d|t − t'|} (e^{−2δm} − e^{−2dm})/(2d − 2δ),   m = min(t, t')
        [Ornstein & Uhlenbeck 1930, with fading noise]
    ln L = −ln det V − |z − A e^{pt}|² in V⁻¹,   V = |A|² w² C + noise;
        A in closed form, d and w summed over grids, Δω at its best

z is the line's baseband over all strikes at once, in short frames: weighted with the model's pattern, so that a
neighbour of another pattern cancels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sonic_bullet.lab.effects.common.ringing import single_hits
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import positive_hann

FRAME_S = 0.012
LEAST = 4  # frames: in less no tail shows
FASTEST = 300.0  # 1/s: what dies sooner is gone within a frame or two, and how soon is not identifiable
STANDARD_ERRORS = 0.1  # of a decay and of an amplitude: the tail's early echoes are no noise


@dataclass(frozen=True, slots=True, eq=False)
class TailEstimates:
    """Estimates of k lines at each of t rates δ.

    Attributes
    ----------
    delta : (t,)
        Rates in 1/s.
    ln_likelihood : (t, k)
        Of each line.
    plain : (k,)
        The same without a tail, at the same decays.
    decay_per_s, ln_sd : (t, k)
        The line's own decay, and the spread of its logarithm.
    shift_hz : (t, k)
        Its frequency over that given.
    amplitude, amplitude_sd : (t, k)
        Over the model's so far, complex, and its spread.
    reverberant_level : (t, k)
        w.
    """

    delta: Array
    ln_likelihood: Array
    plain: Array
    decay_per_s: Array
    ln_sd: Array
    shift_hz: Array
    amplitude: Array
    amplitude_sd: Array
    reverberant_level: Array


def estimate_rates(
    h: ObjectEvidence, delta: Array, freq_hz: Array, own: Array, members: Sequence[Array], *, every: int = 1
) -> TailEstimates:
    """Estimate lines at several rates δ.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    delta : (t,)
        Rates in 1/s.
    freq_hz : (k,)
        Frequencies of the lines.
    own : (s, k) complex
        Unit of each line's amplitudes.
    members : sequence of arrays
        Indices of each line's modes; all others are its neighbours.
    every : int
        Use one of so many decays, for a first estimate.
    """
    assert h.signal is not None
    start, window = _frames(h)
    z, noise = _basebands(h, freq_hz, own, members, start, window)
    time = tuple((start / h.sr).tolist())
    decays = np.geomspace(0.5, 600.0, 31)
    rows = [[_at(z, noise, time, float(d), float(one)) for d in decays[::every]] for one in delta]
    return _sum_rates(delta, decays[::every], rows)


def modes(h: ObjectEvidence, delta: Array, lines: Array, *, every: int = 1) -> TailEstimates:
    """Estimate some of an object's lines (k,), by index, in units of the model so far."""
    return estimate_rates(
        h, delta, h.freq_hz[lines], expected_amplitude(h)[:, lines], [h.mode[k] for k in lines], every=every
    )


def expected_amplitude(h: ObjectEvidence) -> Array:
    """Return the lines' amplitudes (s, k) by the model so far, complex."""
    return np.stack([h.push[:, m].sum(axis=1) for m in h.mode], axis=1)


@lru_cache(maxsize=4)
def through(h: ObjectEvidence, delta: float) -> TailEstimates:
    """Estimate all lines of an object at one δ; cached, as effects ask more than once.

    A line that outlasts the tail keeps its observed values: late, it is undisturbed.
    """
    outlasts = 0.5  # of the tail's decay: what falls slower has the recording to itself in the end
    r = modes(h, np.array([delta]), np.arange(len(h.freq_hz)))
    sd = h.decay_sd_per_s / np.maximum(h.decay_per_s, 1e-9)
    # by both: a faint line may beat with the tail's own
    alone = (h.decay_per_s < outlasts * delta) & (r.decay_per_s < delta) & (sd < STANDARD_ERRORS)
    return replace(
        r,
        decay_per_s=np.where(alone, h.decay_per_s, r.decay_per_s),
        ln_sd=np.where(alone, sd, r.ln_sd),
        shift_hz=np.where(alone, 0.0, r.shift_hz),
    )


def remove_tail(h: ObjectEvidence, delta: float, *, foreign: bool = True) -> ObjectEvidence:
    """Return an object with frequencies, decays and amplitudes of all lines as without the tail.

    Lines that are no mode are assumed to follow the impulse; foreign: whether they are asked, too. There are often more
    of them than of modes.
    """
    # times longer than it is observed to ring: no line's own, though a tail makes several of one, which end sooner
    owns = 8.0
    if h.dry or h.signal is None or not len(h.freq_hz) or h.signal.shape[1] < LEAST * FRAME_S * h.sr:
        return h
    r = through(h, delta)
    own, decay = expected_amplitude(h), r.decay_per_s[0]
    amplitude, spread = _rescale_amplitudes(r, own, h.amplitude, h.amplitude_sd)
    like = np.abs((np.conj(own) * h.amplitude).sum(axis=0)) ** 2 / np.maximum(
        (np.abs(own) ** 2).sum(axis=0) * (np.abs(h.amplitude) ** 2).sum(axis=0), 1e-300
    )
    # squared cosine of amplitudes over the strikes and what the model says: a line less like its mode is the room's own
    like_tail = 0.7
    ln_sd = np.where((decay > FASTEST) | (like < like_tail), np.inf, np.hypot(r.ln_sd[0], STANDARD_ERRORS))
    dry = replace(
        h,
        freq_hz=h.freq_hz + r.shift_hz[0],
        decay_per_s=decay,
        freq_sd_hz=np.hypot(h.freq_sd_hz, decay / (2 * np.pi) * r.ln_sd[0]),
        decay_sd_per_s=ln_sd * decay,
        amplitude=amplitude,
        amplitude_sd=spread,
        dry=True,
    )
    if not foreign or not len(h.foreign_hz):
        return dry
    level = h.level_n_s
    alone = np.repeat(level[:, None], len(h.foreign_hz), axis=1).astype(complex)
    r = estimate_rates(h, np.array([delta]), h.foreign_hz, alone, [np.zeros(0, int)] * len(h.foreign_hz))
    amplitude, _ = _rescale_amplitudes(r, alone, h.foreign_amplitude, h.foreign_sd)
    # what strikes have in common says nothing of how they differ
    strange = h.foreign_sd * np.abs(amplitude) / np.maximum(np.abs(h.foreign_amplitude), 1e-300)
    # a tail prolongs: what is read to ring longer than it is observed to is a neighbour's
    other = r.decay_per_s[0] * owns < h.foreign_decay_per_s
    return replace(
        dry,
        foreign_hz=h.foreign_hz + np.where(other, 0, r.shift_hz[0]),
        foreign_decay_per_s=np.where(other, h.foreign_decay_per_s, r.decay_per_s[0]),
        foreign_amplitude=np.where(other, h.foreign_amplitude, amplitude),
        foreign_sd=np.where(other, h.foreign_sd, strange),
    )


def _rescale_amplitudes(r: TailEstimates, own: Array, amplitude: Array, sd: Array) -> tuple[Array, Array]:
    """Rescale amplitudes and spreads (s, k) by the estimate of what all strikes have in common."""
    now = (np.conj(own) * amplitude).sum(axis=0) / np.maximum((np.abs(own) ** 2).sum(axis=0), 1e-300)
    # the model says nothing of them: they stay as they were observed
    silent = (np.abs(own).sum(axis=0) == 0) | (now == 0)
    factor = np.where(silent, 1, r.amplitude[0] / np.where(silent, 1, now))
    common = np.abs(own) * np.hypot(r.amplitude_sd[0], STANDARD_ERRORS * np.abs(r.amplitude[0]))
    # where a mode is hardly struck, more is observed of it than the model says
    common = np.maximum(common, STANDARD_ERRORS * np.abs(amplitude * factor))
    return amplitude * factor, np.hypot(sd * np.abs(factor), common)


def direct(h: ObjectEvidence, delta: float) -> Array:
    """Synthesize the strikes (s, n) without the tail: lines' modes as estimated, others as the nearest of those."""
    r = through(h, delta)
    near = np.abs(np.log(h.all_hz[:, None] / h.freq_hz)).argmin(axis=1)
    shift = np.zeros(len(h.all_hz))
    for k, members in enumerate(h.mode):
        near[members], shift[members] = k, h.freq_hz[k] + r.shift_hz[0, k] - h.all_hz[members]
    return single_hits(h, h.all_hz + shift, r.decay_per_s[0, near], h.push * r.amplitude[0, near])


def _frames(h: ObjectEvidence) -> tuple[Array, Array]:
    """Return the first samples (n,) of the frames, and their window."""
    assert h.signal is not None
    window = positive_hann(round(FRAME_S * h.sr))
    hop = len(window) // 2
    last = max((h.signal.shape[1] - len(window)) // hop, 1)
    dense_frames, frame_count = 24, 56  # frames one after another, then ever farther apart
    dense = np.arange(min(dense_frames, last))
    sparse = (
        np.geomspace(dense_frames, last, frame_count - dense_frames).round().astype(int)
        if last > dense_frames
        else dense[:0]
    )
    return hop * np.unique(np.concatenate([dense, sparse])), window / window.sum()


def _basebands(
    h: ObjectEvidence, freq: Array, own: Array, members: Sequence[Array], start: Array, window: Array
) -> tuple[Array, Array]:
    """Compute the frames (k, n) of every line in units of its own, and the noise's variance there (k,)."""
    assert h.signal is not None
    at = np.arange(len(window)) / h.sr
    piece = h.signal[:, start[:, None] + np.arange(len(window))] * window
    spectrum = 2 * np.einsum("snt,tk->ksn", piece, np.exp(-2j * np.pi * np.outer(at, freq)), optimize=True)
    spectrum *= np.exp(-2j * np.pi * freq[:, None] * start / h.sr)[:, None, :]
    mixed, noise, white_rms = [], [], h.noise_at(freq)
    pattern = 0.03  # of a line's strongest: what shapes are wrong by
    for i, mine in enumerate(members):
        other = np.setdiff1d(np.flatnonzero(np.abs(h.all_hz - freq[i]) < 2 / FRAME_S), mine)
        through = np.abs(window @ np.exp(2j * np.pi * np.outer(at, h.all_hz[other] - freq[i])))
        near = h.push[:, other] * through
        size = float(np.linalg.norm(own[:, i]))
        spread = near @ near.conj().T + ((pattern * size) ** 2 + 1e-300) * np.eye(len(own))
        row = np.linalg.solve(spread, own[:, i]).conj()
        row = row / (row @ own[:, i]) if size else np.zeros(len(own))
        mixed.append(row @ spectrum[i])
        noise.append(4 * (np.abs(row) ** 2 * white_rms[:, i] ** 2).sum() * (window**2).sum())
    return np.array(mixed), np.maximum(np.array(noise), 1e-300)


@lru_cache(maxsize=4)
def _whitener(time: tuple[float, ...]) -> Array:
    """Compute the matrix (n, n) by which white noise in the frames becomes uncorrelated."""
    value, vector = np.linalg.eigh(_overlap(np.array(time)))
    return np.asarray((vector / np.sqrt(np.maximum(value, 1e-6))) @ vector.T)


def _overlap(time: Array) -> Array:
    """Compute the correlation (n, n) of white noise in two frames of Hann windows.

    At a distance u of their length, (1 − u)(2 + cos 2πu)/3 + sin 2πu/2π [Harris 1978, eq. 9].
    """
    u = np.minimum(np.abs(time[:, None] - time[None, :]) / FRAME_S, 1.0)
    return np.asarray(((1 - u) * (2 + np.cos(2 * np.pi * u)) + 1.5 / np.pi * np.sin(2 * np.pi * u)) / 3)


@lru_cache(maxsize=1500)
def _tail(time: tuple[float, ...], decay: float, delta: float) -> tuple[Array, Array, Array]:
    """Compute the statistics of a tail in the frames (n,) for a decay and a rate, whatever the line.

    Returns the first frame's mean, the variances (n,) of a tail of unit reverberant level along directions that are
    uncorrelated, for white noise of unit variance, and the frames' means and directions there (n, 1 + n).
    """
    nodes = 8  # of a window's quadrature
    faint = 1e-25  # of the direct sound's power
    at = np.array(time)
    node, weight = (np.arange(nodes) + 0.5) / nodes * FRAME_S, positive_hann(nodes)
    weight = weight / weight.sum()
    t = (at[:, None] + node).ravel()
    gap = 2 * (decay - delta)
    var = 2 * delta * np.exp(-2 * delta * t) * (-np.expm1(-gap * t) / gap if gap else t)
    both = np.exp(-decay * np.abs(t[:, None] - t[None, :])) * np.where(
        t[:, None] < t[None, :], var[:, None], var[None, :]
    )
    both = weight @ both.reshape(len(at), nodes, -1)
    both = both.reshape(len(at), len(at), nodes) @ weight
    both[both < faint] = 0.0  # or the solver works on numbers that processors are a hundred times slower with
    white = _whitener(time)
    value, vector = np.linalg.eigh(white @ both @ white)
    mean = np.exp(-decay * (at[:, None] + node)) @ weight
    turn = vector.T @ white
    return mean[0], np.maximum(value, 0), np.column_stack([turn @ mean, turn])


def _at(z: Array, noise: Array, time: tuple[float, ...], decay: float, delta: float) -> tuple[Array, ...]:
    """Compute for every line ln likelihood, A, its spread, the best Δf and w, each (k, w), at one decay and one δ."""
    shifts = 21
    mean, value, turn = _tail(time, decay, delta)
    at = np.array(time)
    half = min(max(2 * max(decay, delta) / np.pi, 2.0), 0.4 / (at[1] - at[0]))
    shift = np.linspace(-half, half, shifts)
    moved = z[:, :, None] * np.exp(-2j * np.pi * at[:, None] * shift)
    # (n,), (k, n, Δ) real and imaginary side by side
    m, b = turn[:, 0], turn[:, 1:] @ moved.view(float).reshape(len(z), len(at), -1)
    b = b.view(complex)
    tail_shares = np.geomspace(1e-3, 4.0, 9)  # |A|² w² over what the first frame suggests |A|² to be
    scale = (np.abs(z[:, 0] / mean) ** 2)[:, None] * tail_shares  # (k, w): |A|² w²
    over = 1 / (scale[:, :, None] * value + noise[:, None, None])  # (k, w, n)
    power, size = over @ (b.real**2 + b.imag**2), over @ m**2  # (k, w, Δ), (k, w)
    cross = ((over * m) @ b.view(float)).view(complex)
    best = (power - (cross.real**2 + cross.imag**2) / size[:, :, None]).argmin(axis=2)
    pick = np.take_along_axis(cross, best[:, :, None], axis=2)[:, :, 0]
    left = np.take_along_axis(power, best[:, :, None], axis=2)[:, :, 0] - np.abs(pick) ** 2 / size
    amplitude = pick / size
    reverberant_level = np.sqrt(scale) / np.maximum(np.abs(amplitude), 1e-300)
    return -left + np.log(over).sum(axis=2), amplitude, 1 / np.sqrt(size), shift[best], reverberant_level


def _sum_rates(delta: Array, decays: Array, rows: list[list[tuple[Array, ...]]]) -> TailEstimates:
    """Sum over decays and reverberant levels: means of ln d and ln w, the rest at the likeliest."""
    # (t, d, k, w)
    like, amplitude, sd, shift, reverberant_level = (
        np.array([[one[i] for one in row] for row in rows]) for i in range(5)
    )
    t, _, k, _ = like.shape
    top = like.max(axis=(1, 3), keepdims=True)
    share = np.exp(like - top)
    by_decay = share.sum(axis=3)
    total = by_decay.sum(axis=1)
    mean = np.einsum("tdk,d->tk", by_decay, np.log(decays)) / total
    square = np.einsum("tdk,d->tk", by_decay, np.log(decays) ** 2) / total
    flat = like.transpose(0, 2, 1, 3).reshape(t, k, -1)
    best = flat.argmax(axis=2)[:, :, None]
    at = [
        np.take_along_axis(x.transpose(0, 2, 1, 3).reshape(t, k, -1), best, axis=2)[:, :, 0]
        for x in (amplitude, sd, shift)
    ]
    mean_level = np.exp((share * np.log(np.maximum(reverberant_level, 1e-300))).sum(axis=(1, 3)) / total)
    plain = like[:, :, :, 0].max(axis=(0, 1))
    step = np.log(decays[1] / decays[0])
    ln_sd = np.sqrt(np.maximum(square - mean**2, 0) + step**2 / 12)
    return TailEstimates(
        delta, top[:, 0, :, 0] + np.log(total), plain, np.exp(mean), ln_sd, at[2], at[0], at[1], mean_level
    )
