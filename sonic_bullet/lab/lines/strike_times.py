"""When a recording was struck: what linear prediction cannot know of.

    recording -> prediction error filter -> power in blocks of 1 ms -> a block far above its neighbourhood: a strike

Beats, swells, hum and slow decays follow from what came before; only a blow does not. What a room sends back within
STRIKE_GAP_S is of the blow before it.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from sonic_bullet.lab.lines.linear_prediction import prediction_error_filter
from sonic_bullet.records import Array

STRIKE_BLOCK_S = 1e-3
STRIKE_GAP_S = 0.05


def find_strikes(signal: Array, sr: int) -> Array:
    """Find when a recording was struck.

    Parameters
    ----------
    signal : (n,) array
        Samples, finite.
    sr : int
        Their rate in Hz.

    Returns
    -------
    (s,) array
        Times in s from the first sample, in order; empty where nothing stands out of what could be predicted.
    """
    sharpened_order = 64  # terms of the recursion: 32 modes, or fewer and a noise's colour
    near_s = 0.25
    above_db = 12.0  # over the median of the blocks within near_s: gaussian noise of 1 ms stays below 3 dB
    below_db = 26.0  # a strike that much below the largest is a neighbour's, a cable's or a reflection's
    block = max(1, round(STRIKE_BLOCK_S * sr))
    count = len(signal) // block
    if count < 20 or not np.any(signal):
        return np.zeros(0)
    left = np.convolve(signal, prediction_error_filter(signal, sharpened_order))
    power = (left[: count * block].reshape(count, block) ** 2).mean(axis=1)
    width = min(round(2 * near_s / STRIKE_BLOCK_S), count) | 1
    near = np.median(sliding_window_view(np.pad(power, width // 2, mode="edge"), width), axis=1)
    stands = power > np.maximum(near * 10 ** (above_db / 10), power.max() * 10 ** (-below_db / 10))
    at = np.flatnonzero(stands) * block / sr
    return at[np.diff(at, prepend=-1.0) > STRIKE_GAP_S]
