"""Look-ahead limiter: the factor that keeps a loudness below a true peak.

    true peak a sample p_i, gain g, ceiling c
      -> r_i = min(0, c - g - p_i)                  dB that sample i must go down
      -> min over j ≤ i of r_j + s·(i - j)          release: back by s dB a sample
      -> min over j from i to i + w                 look-ahead: down before the peak comes
      -> mean over w, by a Hann window              no corner: each mean is of values ≤ r_i, so it is, too
      -> 10^(·/20), for all channels alike

Its form is that of Giannoulis, Massberg, Reiss, "Digital Dynamic Range Compressor Design", JAES 60(6), 2012, sec. 2 (a
static curve at ratio ∞, then smoothing in decibels), with the smoothing moved ahead of the peak.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.short_time import positive_hann


def limiter_factor(peak_db: Array, sr: int, ceiling_db: float, release_db_s: float) -> Array:
    """Return factors (n,) that bring true peaks (n,) in dB down to at most ``ceiling_db``."""
    # One period of 200 Hz: the descent is too slow to be audible as a click, and the strike after it masks it
    lookahead_s = 0.005
    from scipy.ndimage import minimum_filter1d
    from scipy.signal import oaconvolve

    wanted = np.minimum(0.0, ceiling_db - peak_db)
    slope = release_db_s / sr * np.arange(len(wanted))
    held = np.minimum.accumulate(wanted - slope) + slope
    width = 2 * round(lookahead_s * sr / 2) + 1
    padded = np.concatenate([held, np.repeat(held[-1:], width - 1)])
    # of frames i … i + width - 1, at i; the mean at i is then of those that began i - width + 1 … i, all of which saw i
    ahead = minimum_filter1d(np.minimum(padded, 0.0), width, origin=-(width // 2))[: len(wanted)]
    window = positive_hann(width)
    before = np.concatenate([np.repeat(ahead[:1], width - 1), ahead])
    return np.asarray(10 ** (np.minimum(oaconvolve(before, window / window.sum(), mode="valid"), 0.0) / 20))
