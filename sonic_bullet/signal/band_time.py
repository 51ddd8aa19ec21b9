"""Levels of a sound by band and time, and how far two sounds are from each other there.

    take -> thirds of octaves -> mean power in blocks of 8 ms, less the noise -> cells: thirds × times that double
    D = √<(ΔL − median ΔL)²> over cells where either stands above the noise of the second

The gain is free, as strength and distance are not declared. Dense spectra of two takes differ cell by cell by the
chance of their phases (5.6 dB of a cell of one degree of freedom): the floor of D is measured, not assumed.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonic_bullet.records import Array

BLOCK_S = 0.008
THIRDS_HZ = 1000.0 * 2.0 ** (np.arange(-13, 13) / 3)
EDGES_S = (0.0, 0.016, 0.032, 0.064, 0.128, 0.256, 0.512, 1.024, 2.048)
ABOVE_NOISE_DB = 6.0


@dataclass(frozen=True, slots=True, eq=False)
class BandTime:
    """Power (b, m) of thirds of octaves in blocks, without noise, and the noise's power (b,)."""

    power: Array
    noise: Array

    @property
    def time_s(self) -> Array:
        """Middles of the blocks (m,)."""
        return (np.arange(self.power.shape[1]) + 0.5) * BLOCK_S


def band_time(signal: Array, sr: int) -> BandTime:
    """Measure a take (n,) from its onset on."""
    from scipy.fft import irfft, next_fast_len, rfft

    seconds = EDGES_S[-1]
    signal = signal[: round(seconds * sr)]
    block = round(BLOCK_S * sr)
    count = len(signal) // block
    size = next_fast_len(len(signal) + sr // 10, real=True)
    spectrum = rfft(signal, size)
    freq = np.fft.rfftfreq(size, 1 / sr)
    bands = THIRDS_HZ[0.49 * sr > THIRDS_HZ * 2 ** (1 / 6)]
    power = np.empty((len(bands), count))
    place = np.log2(np.maximum(freq, 1e-3))
    for row, middle in zip(power, bands, strict=True):
        away = np.abs(place - np.log2(middle)) * 3
        mask = np.cos(np.pi / 2 * np.clip((away - 0.25) / 0.5, 0, 1))
        inside = np.flatnonzero(mask)
        part = np.zeros(len(spectrum), complex)
        part[inside] = spectrum[inside] * mask[inside]
        row[:] = (irfft(part, size)[: count * block].reshape(count, block) ** 2).mean(axis=1)
    tail = max(6, count // 10)
    noise, earlier = np.median(power[:, -tail:], axis=1), np.median(power[:, -2 * tail : -tail], axis=1)
    falling, hidden = 1.25, 0.1  # what falls by 1 dB over its last tenth still rings: its noise lies below
    noise = np.where(earlier > falling * noise, hidden * noise, noise)
    return BandTime(np.maximum(power - noise[:, None], 0.0), noise)


def cell_levels(sound: BandTime, noise: Array | None = None) -> Array:
    """Levels (b, c) in dB of the cells, with a noise (b,) in them: the sound's own where none is given."""
    edges = np.round(np.array(EDGES_S) / BLOCK_S).astype(int)
    edges = np.minimum(edges, sound.power.shape[1])
    noise = sound.noise if noise is None else noise
    cells = [
        sound.power[:, a:b].mean(axis=1) if b > a else np.full(len(sound.power), np.nan) for a, b in pairwise(edges)
    ]
    return np.asarray(10 * np.log10(np.maximum(np.array(cells).T + noise[:, None], 1e-30)))


def level_distance_db(sound: BandTime, recorded: BandTime) -> float:
    """Distance of a sound from one that was heard, in whose noise both are; NaN where no cell stands out of it."""
    reference = cell_levels(recorded)
    # the free gain and the noise depend on each other: a few rounds settle them
    gain = 0.0
    seen = np.zeros(reference.shape, bool)
    off = np.zeros(reference.shape)
    floor = 10 * np.log10(np.maximum(recorded.noise, 1e-30))[:, None] + ABOVE_NOISE_DB
    for _ in range(4):
        level = cell_levels(BandTime(sound.power * 10 ** (gain / 10), recorded.noise))
        seen = np.isfinite(level) & np.isfinite(reference) & (np.maximum(level, reference) > floor)
        if not seen.any():
            return float("nan")
        off = level - reference
        gain -= float(np.median(off[seen]))
    return float(np.sqrt((off[seen] ** 2).mean()))
