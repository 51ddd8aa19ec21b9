"""Peaks of a sampled curve."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def local_peaks(curve: Array) -> Array:
    """Find the inner samples (p,) of a curve (n,) that are above their neighbours; the last of a plateau."""
    return np.flatnonzero((curve[1:-1] >= curve[:-2]) & (curve[1:-1] > curve[2:])) + 1
