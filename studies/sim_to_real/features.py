"""What a classifier sees of a sound: a log-mel picture of its first second, statistics of it, and its lines.

sound -> 1 ms before the onset -> 24 kHz -> mel spectrogram -> dB of its maximum, at least FLOOR_DB -> picture (b, t)
    -> by band: level in windows of time, and its fall -> statistics (f,)
    -> by band: how fast it falls -> decays (d,)
    -> spectrum of what rings -> lines, how many, how far apart, how low -> (8,)
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


def statistics(pictures: Any) -> Array:
    """Compute statistics (n, f) of pictures."""
    return np.array([statistics_of(one) for one in pictures])
