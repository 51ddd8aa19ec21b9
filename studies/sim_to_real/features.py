"""What a classifier sees of a sound: a log-mel picture of its first second, statistics of it, and its lines.

sound -> 1 ms before the onset -> 24 kHz -> mel spectrogram -> dB of its maximum, at least FLOOR_DB -> picture (b, t)
    -> by band: level in windows of time, and its fall -> statistics (f,)
    -> by band: how fast it falls -> decays (d,)
    -> spectrum of what rings -> lines, how many, how far apart, how low -> (8,)
                              -> the fall of each in frames of its own -> loss factors, by quantile and octave -> (31,)
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from sonic_bullet.records import Array

SR = 24_000
BANDS, FRAME_S, HOP_S, LENGTH_S = 40, 0.02, 0.01, 1.0
LOWEST_HZ, HIGHEST_HZ = 100.0, 10_000.0
FLOOR_DB = -60.0
MOST_LINES = 24
LOSS_BETWEEN = (3e-5, 0.3)
"""Loss factors that are told apart: less falls by under 1 dB in a second at 1 kHz, more is over in two cycles."""
TIMES_S = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 1.0)


def resampled(sound: Array, sr: int) -> Array:
    """Return a sound (n,) at `SR`."""
    from scipy.signal import resample_poly

    common = int(np.gcd(sr, SR))
    return np.asarray(sound if sr == SR else resample_poly(sound, SR // common, sr // common))


def cut_at_random(sound: Array, sr: int, seed: int) -> Array:
    """Cut a simulated sound (n,) 0.25 s after its peak or later: takes end at the next hit, or where a file ends."""
    shortest_s = 0.25
    length_s = float(np.exp(np.random.default_rng(seed).uniform(np.log(shortest_s), np.log(2.0))))
    return sound[: int(np.argmax(np.abs(sound))) + round(length_s * sr)]


def from_onset(sound: Array) -> Array:
    """Cut what lies before a tenth of the peak, but for 1 ms; what is missing at the end is silence."""
    first = max(0, int(np.argmax(np.abs(sound) > 0.1 * np.abs(sound).max())) - round(0.001 * SR))
    made = np.zeros(round(LENGTH_S * SR))
    piece = sound[first : first + len(made)]
    made[: len(piece)] = piece
    return made


def _filters() -> Array:
    """Return triangles (b, k) on the mel scale of O'Shaughnessy 1987."""
    mel = np.linspace(*(2595 * np.log10(1 + np.array([LOWEST_HZ, HIGHEST_HZ]) / 700)), BANDS + 2)
    edge = 700 * (10 ** (mel / 2595) - 1)
    at = np.fft.rfftfreq(2 * round(FRAME_S * SR), 1 / SR)
    low, middle, high = edge[:-2, None], edge[1:-1, None], edge[2:, None]
    return np.asarray(np.clip(np.minimum((at - low) / (middle - low), (high - at) / (high - middle)), 0, None))


FILTERS = _filters()


def picture_of(sound: Array, sr: int) -> Array:
    """Compute the picture (b, t) float32 in dB of its maximum."""
    one = from_onset(resampled(sound, sr))
    width, hop = round(FRAME_S * SR), round(HOP_S * SR)
    frames = np.lib.stride_tricks.sliding_window_view(one, width)[::hop] * np.hanning(width)
    power = np.abs(np.fft.rfft(frames, 2 * width)) ** 2 @ FILTERS.T
    level = 10 * np.log10(np.maximum(power / power.max(), 10 ** (FLOOR_DB / 10)))
    return np.asarray(level.T, np.float32)


def statistics_of(picture: Array) -> Array:
    """Compute statistics (f,) of a picture: levels in windows, and how many frames a band stays within 20 dB."""
    edges = [round(t / HOP_S) for t in TIMES_S]
    windows = [picture[:, a : max(b, a + 1)].mean(axis=1) for a, b in pairwise(edges)]
    top = picture.max(axis=1, keepdims=True)
    lasting = np.log1p((picture > np.maximum(top - 20, FLOOR_DB + 1)).sum(axis=1))
    return np.concatenate([*windows, lasting])


def decays_of(picture: Array) -> Array:
    """Compute how fast bands fall from their peak over 20 dB, to the floor or to the take's end: log10 of dB a frame.

    (3 + 8 + b,): mean over bands by their level, the mean band, how both go together; of groups of bands; of bands.
    """
    least = 0.05  # dB a frame: T60 of 12 s
    picture = picture[:, : max(int(np.flatnonzero(picture.max(axis=0) > FLOOR_DB)[-1]), 3)]  # silence follows a take
    rate, weight = np.zeros(len(picture)), np.zeros(len(picture))
    for number, band in enumerate(picture):
        first = int(band[:10].argmax())
        gone = (band[first:] < band[first] - 20) | (band[first:] < FLOOR_DB + 4)
        last = int(np.argmax(gone)) if gone.any() else len(gone) - 1
        fall = (band[first] - band[first + max(last, 2)]) / max(last, 2)
        rate[number], weight[number] = np.log10(max(fall, least)), (band[first] - FLOOR_DB) ** 2
    at, total = np.arange(len(picture)), weight.sum()
    mean, middle = weight @ rate / total, weight @ at / total
    together = weight @ ((rate - mean) * (at - middle)) / total
    groups = [w @ r / max(w.sum(), 1e-9) for w, r in zip(weight.reshape(8, -1), rate.reshape(8, -1), strict=True)]
    return np.array([mean, middle, together, *groups, *rate])


def lines_of(sound: Array, sr: int) -> Array:
    """Describe the lines (8,) of what rings from 20 to 350 ms: peaks of its spectrum, Hz apart, by 10 dB."""
    from scipy.signal import find_peaks

    piece = from_onset(resampled(sound, sr))[round(0.02 * SR) : round(0.35 * SR)]
    level = 20 * np.log10(np.abs(np.fft.rfft(piece * np.hanning(len(piece)), SR)) + 1e-12)[: round(HIGHEST_HZ)]
    at, _ = find_peaks(level, height=level.max() - 40, prominence=10)
    if len(at) == 0:
        return np.zeros(8)
    below = level[at] - level.max()
    loudest = at[np.argsort(-below)[:5]]
    apart = float(np.median(np.diff(at))) if len(at) > 1 else 0.0
    centre = np.average(np.log(at), weights=10 ** (below / 20))
    low, mean = np.log(np.sort(loudest)[0]), np.log(loudest.mean())
    return np.array([len(at), (below > -20).sum(), (below > -30).sum(), apart, np.log(at[0]), low, mean, centre])


def ringing_of(sound: Array, sr: int) -> tuple[Array, Array, Array, Array]:
    """Return frequency, level in dB, loss factor and misfit in dB (k,) of the lines that ring, the loudest first.

    η = 2.2/(f T60) of the fall from a line's peak over 30 dB, to its noise or to the take's end, in frames of 20 of
    its cycles: as long as the shortest line of these materials takes to fall by 15 dB.
    """
    from scipy.signal import find_peaks

    piece = _uncut(resampled(sound, sr))
    late = piece[round(0.01 * SR) : round(0.25 * SR)]
    level = 20 * np.log10(np.abs(np.fft.rfft(late * np.hanning(len(late)), 2 * SR // 5)) + 1e-12)
    low, high = round(LOWEST_HZ / 2.5), round(HIGHEST_HZ / 2.5)  # bins of 2.5 Hz
    top = level[low:high].max()
    at, _ = find_peaks(level[:high], height=top - 40, prominence=6)
    at = at[at >= low]
    chosen = list[int]()
    for one in at[np.argsort(-level[at])]:  # nearer ones share a frame
        if all(abs(one - other) > max(0.05 * other, 10) for other in chosen) and len(chosen) < MOST_LINES:
            chosen.append(int(one))
    rows = [(2.5 * one, level[one] - top, *_loss(piece, 2.5 * one)) for one in chosen]
    freq, level, loss, misfit = np.array([row for row in rows if row[2] > 0]).reshape(-1, 4).T
    return freq, level, loss, misfit


def _uncut(sound: Array) -> Array:
    """Return a sound (n,) from its onset on, at most `LENGTH_S`, at least 0.1 s."""
    first = max(0, int(np.argmax(np.abs(sound) > 0.1 * np.abs(sound).max())) - round(0.001 * SR))
    piece = sound[first : first + round(LENGTH_S * SR)]
    return np.pad(piece, (0, max(0, SR // 10 - len(piece))))


def _loss(piece: Array, freq_hz: float) -> tuple[float, float]:
    """Return the loss factor of a line, and the rms by which its level leaves a straight fall; 0 where it has none."""
    width = min(round(20 / freq_hz * SR), len(piece) // 4)
    angle = 2 * np.pi * freq_hz / SR * np.arange(width)
    turn = np.hanning(width)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    every = np.lib.stride_tricks.sliding_window_view(piece, width)
    for hop in (width // 4, width, 4 * width):  # longer steps where it is not over by then
        frames = np.ascontiguousarray(every[:: max(hop, 1)][:48])
        level = 10 * np.log10(((frames @ turn) ** 2).sum(axis=1) + 1e-24)
        first = int(level[:8].argmax())
        gone = level[first:] < level[first] - 30
        if gone.any() or len(frames) < 48:
            break
    floor = np.median(level[-max(len(level) // 6, 1) :]) + 6
    gone |= level[first:] < floor
    count = int(gone.argmax()) if gone.any() else len(level) - first
    if count < 4:
        return 0.0, 0.0
    t = hop / SR * np.arange(count)
    slope, start = np.polyfit(t, level[first : first + count], 1)
    misfit = float(np.sqrt(((level[first : first + count] - start - slope * t) ** 2).mean()))
    return float(np.clip(-slope / (60 / 2.2 * freq_hz), *LOSS_BETWEEN)), misfit


def losses_of(sound: Array, sr: int) -> Array:
    """Describe what rings (31,): loss factors by quantile, by octave and of the loudest, how they go with frequency.

    And how many lines there are, how dense, how low, how much of the sound they hold, and how bright the strike is.
    """
    piece = _uncut(resampled(sound, sr))
    power = np.abs(np.fft.rfft(piece[: SR // 100] * np.hanning(SR // 100), SR)) ** 2
    attack = np.average(np.log(np.arange(100, 10_000)), weights=power[100:10_000] + 1e-30)
    freq, level, loss, misfit = ringing_of(sound, sr)
    if len(freq) == 0:
        return np.concatenate([np.full(20, np.nan), np.zeros(10), [attack]])
    level = level - level.max()
    weight = 10 ** (level / 40)
    log_f, log_loss = np.log(freq), np.log10(loss)
    order = np.argsort(log_loss)
    place = (np.cumsum(weight[order]) - 0.5 * weight[order]) / weight.sum()
    quantiles = np.interp([0.1, 0.25, 0.5, 0.75, 0.9], place, log_loss[order])
    middle = quantiles[2]
    loudest = np.append(log_loss[:3], [middle] * 3)[:3]
    octave = np.round(np.log2(freq / 250)).astype(int)
    octaves = [np.average(log_loss[octave == k], weights=weight[octave == k]) if (octave == k).any() else middle
               for k in range(6)]  # fmt: skip
    x = log_f - np.log(1000)
    centre = np.average(x, weights=weight)
    spread = weight @ (x - centre) ** 2 + 0.1 * weight.sum()  # a prior: no change over 0.3 in ln f
    tilt = weight @ ((x - centre) * (log_loss - np.average(log_loss, weights=weight))) / spread
    lasting = np.log10(2.2 / (freq * loss))
    spectrum = np.abs(np.fft.rfft(piece)) ** 2
    at = np.fft.rfftfreq(len(piece), 1 / SR)
    near = (np.abs(at[:, None] - freq) < np.maximum(10.0, 2 * loss * freq)).any(axis=1)
    inside = spectrum[near].sum() / max(spectrum[at > LOWEST_HZ].sum(), 1e-30)
    apart = np.log(np.median(np.diff(np.sort(freq)))) if len(freq) > 1 else np.log(HIGHEST_HZ)
    return np.array([
        *quantiles, *loudest, *octaves, tilt, middle - tilt * centre, float(np.std(log_loss)),
        np.average(lasting, weights=weight), lasting.max(), np.median(misfit),
        len(freq), (level > -20).sum(), (level > -10).sum(), apart, log_f.min(), log_f[level > -20].min(), log_f[0],
        centre, min(inside, 1.0), np.log(len(piece) / SR), attack,
    ])  # fmt: skip


def statistics(pictures: Any) -> Array:
    """Compute statistics (n, f) of pictures."""
    return np.array([statistics_of(one) for one in pictures])
