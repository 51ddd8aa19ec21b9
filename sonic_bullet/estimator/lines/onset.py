"""Where an impact starts in a recording, where the next one interrupts it, and what in the recording is no honest
signal.

energy in blocks of 1 ms -> the first block within 20 dB of the loudest -> first sample above the noise in that block ->
about the onset the modes observed after it, run backwards, against silence: the sample where the sound takes over from
silence -> the onset a later rise of half of all bands by `AGAIN_DB` above what they held the 30 ms before: another hit;
what follows it is left out. Beats are no hit: they swell in their own bands only
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.estimator.lines.likelihood import Sinusoids
from sonic_bullet.records import Array

BLOCK_S = 1e-3
AGAIN_DB, NEAR_DB = 6.0, 20.0
LEAST_GAP_S = 0.02
FRAME_S, BANDS = 5e-3, 24
CLIPPED_RUN = 3
REACH = 64  # samples that the first guess may be off


@dataclass(frozen=True, slots=True)
class Span:
    """Samples from the onset to the end or the next hit; hits: how many onsets there are; before: samples that
    precede it.
    """

    start: int
    stop: int
    hits: int


def levels(signal: Array, sr: int) -> tuple[Array, int]:
    """Mean square (b,) in blocks of 1 ms, and the block's length in samples."""
    block = max(1, int(BLOCK_S * sr))
    count = len(signal) // block
    return (signal[: count * block].reshape(count, block) ** 2).mean(axis=1), block


def span(signal: Array, sr: int) -> Span:
    """The first impact of a recording (n,) that is not silent."""
    power, block = levels(signal, sr)
    if len(power) < 4:
        return Span(0, len(signal), 1)
    floor = max(float(np.quantile(power, 0.05)), 1e-20)
    early = int(np.argmax(power >= power.max() * 10 ** (-NEAR_DB / 10)))  # the first hit, be a later one louder
    loud = early + int(np.argmax(power[early : early + 10]))
    quiet = np.flatnonzero(power[:loud] < max(1e-3 * power[loud], 4 * floor))
    first = int(quiet[-1]) if len(quiet) else 0
    before = signal[: max(first, 0) * block]
    sigma = float(np.sqrt((before[-50 * block :] ** 2).mean())) if len(before) > block else 0.0
    edge = max(6 * sigma, 0.02 * float(np.abs(signal).max()))
    over = np.flatnonzero(np.abs(signal[first * block :]) > edge)
    start = first * block + (int(over[0]) if len(over) else 0)
    again = _hits(signal[start:], sr, float(power[loud]))
    if not len(again):
        return Span(start, len(signal), 1)
    return Span(start, start + int(again[0]), 1 + len(again))


def _hits(signal: Array, sr: int, loudest: float) -> Array:
    """Samples (h,) at which bands rise together again, at least `LEAST_GAP_S` after the start and after one another."""
    frame = 1 << round(np.log2(FRAME_S * sr))
    count = len(signal) // frame
    if count < 12:
        return np.zeros(0, int)
    frames = signal[: count * frame].reshape(count, frame)
    power = np.abs(np.fft.rfft(frames * np.hanning(frame + 2)[1:-1], axis=1)) ** 2
    edge = np.unique(np.geomspace(2, frame // 2, BANDS + 1).astype(int))
    level = 10 * np.log10(np.add.reduceat(power[:, : edge[-1]], edge[:-1], axis=1) + 1e-20)
    reach = 6
    before = np.lib.stride_tricks.sliding_window_view(level, reach, axis=0).max(axis=2)[:-1]
    rise = np.median(np.maximum(level[reach:], np.roll(level, -1, axis=0)[reach:]) - before, axis=1)
    near = (frames[reach:] ** 2).mean(axis=1) > loudest * 10 ** (-NEAR_DB / 10)
    sample = (np.flatnonzero((rise > AGAIN_DB) & near) + reach) * frame
    sample = sample[sample < len(signal) - LEAST_GAP_S * sr]
    kept: list[int] = []
    for at in sample[sample > LEAST_GAP_S * sr]:
        if not kept or at - kept[-1] > 2 * LEAST_GAP_S * sr:
            kept.append(int(at) - frame)
    return np.array(kept, int)


def by_modes(signal: Array, start: int, modes: Sinusoids, sr: int, noise: float) -> int:
    """The sample at which the modes, of amplitudes at sample ``start``, take over from silence: the earliest of the
    likeliest.

    Σ_{n<t} x² + Σ_{n≥t} (x − m)² is least at the true t; a sine begins with a zero, which silence explains as well:
    hence the earliest within (3 noise)² of the least. Nothing is assumed of the phases.
    """
    first, last = max(0, start - REACH), min(len(signal), start + REACH)
    n = np.arange(first, last)
    model = (modes.amplitude * np.exp(modes.pole / sr * (n - start)[:, None])).real.sum(axis=1)
    x = signal[first:last]
    gain = np.concatenate([[0.0], np.cumsum((x - model) ** 2 - x**2)])  # of calling n < t modes too
    cost = gain[-1] - gain
    zero = max(noise, 1e-6 * float(np.sqrt((x**2).mean())))
    return first + int(np.flatnonzero(cost <= cost.min() + 9 * zero**2)[0])


def clipped_samples(signal: Array) -> int:
    """How many samples stand in runs of `CLIPPED_RUN` and more at the largest magnitude: the recorder's ceiling."""
    top = np.abs(signal) >= np.abs(signal).max() * (1 - 1e-6)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]]).astype(np.int8)))
    run = edges[1::2] - edges[::2]
    return int(run[run >= CLIPPED_RUN].sum())
