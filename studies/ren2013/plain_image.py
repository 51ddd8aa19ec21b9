"""The image's distance the long way: every sample made, every frame transformed. The closed form is held against it."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.perceptual.image import pool_powers, window
from sonic_bullet.signal.perceptual.loudness import loudness
from sonic_bullet.signal.short_time import short_time_power
from studies.ren2013.hybrid.image import Image


def plain_distance(target: Image, freq_hz: Array, decay_per_s: Array, amplitude: Array) -> float:
    """Π_psycho over its value for silence, by synthesis and Fourier transforms: what `distance` must equal. (m,) each.

    Source: eq. 19.
    """
    time = (
        np.arange(max(level.window + level.hop * (len(level.loud) - 1) for level in target.levels)) / target.sr
        + target.late_s
    )
    signal = np.zeros(len(time))
    for freq, decay, size in zip(freq_hz, decay_per_s, amplitude, strict=True):
        signal += size * np.exp(-decay * time) * np.sin(2 * np.pi * freq * time)
    total = 0.0
    for level in target.levels:
        power = short_time_power(signal, window(level.window), level.hop) * level.scale
        loud = loudness(
            pool_powers(power, level.band, level.share, len(target.middle_hz)),
            target.middle_hz,
            target.full_scale_db_spl,
        )
        total += level.hop * float(((loud[: len(level.loud)] - level.loud) ** 2).sum())
    return total / target.norm
