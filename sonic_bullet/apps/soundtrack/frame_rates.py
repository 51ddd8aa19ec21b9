"""Frame rates from times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.records import Array

EXACT = 1e-5
"""Relative error allowed in a rate that was measured over all of an animation."""


def nearest_rate(rate: float, within: float = EXACT) -> float:
    """Round a measured rate to a near whole number n, or n·1000/1001 [SMPTE ST 12-1, sec. 4], else keep it."""
    usual = [whole * share for share in (1.0, 1000 / 1001) for whole in (round(rate / share),)]
    return min((one for one in usual if abs(rate / one - 1) < within), key=lambda one: abs(rate - one), default=rate)


def rate_of_keys(times: Sequence[Array]) -> float:
    """Estimate frames a second of baked keys; `usual_fps` where they are sparse.

    From the sampler that has most keys, over all of it, where they are even but for float32; else the median of all
    distances.
    """
    gaps = np.concatenate([np.diff(t) for t in times])
    usual_fps = 30.0
    if len(gaps) < 8:
        return usual_fps
    longest = max(times, key=len)
    # relative error allowed in the median distance of keys: less than half of what is between n and n·1000/1001
    uneven_keys = 4e-4
    rate, within = 1 / float(np.median(gaps)), uneven_keys
    own = np.diff(longest)
    if len(own) >= 8 and np.abs(own - own.mean()).max() <= 2 * np.spacing(np.float32(longest[-1])):
        rate, within = 1 / float(own.mean()), EXACT
    return nearest_rate(rate, within) if rate >= 10 else usual_fps
