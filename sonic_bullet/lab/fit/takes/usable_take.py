"""Whether a take can be fitted: long enough, and not at its peak, for a fit of it would be of the limiter."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError


def refuse_clipped(sound: Array, name: object) -> None:
    """Raise AudioError where a channel stands at its peak."""
    clipped = 8  # samples in a row at the file's peak
    clipped_runs = 4  # or as many rows of three: a sound that decays has one highest peak
    peak = float(np.abs(sound).max())
    runs = np.convolve(np.abs(sound) >= 0.9999 * peak, np.ones(clipped), "valid")
    rows = np.convolve(np.abs(sound) >= (1 - 1e-6) * peak, np.ones(3), "valid") > 2.5
    flat = int((np.diff(rows.astype(np.int8), prepend=0) > 0).sum())
    if (len(runs) and runs.max() >= clipped) or flat >= clipped_runs:
        raise AudioError(
            f"{name} is clipped: rows of samples stand at its peak",
            "leave it out, or record at a lower level; a fit of it would be of the limiter",
        )


def refuse_short(count: int, sr: int, name: object) -> None:
    """Raise AudioError where so many samples after an onset are too few."""
    least_samples, least_s = 256, 0.02  # after an onset
    least = max(least_samples, least_s * sr)
    if count < least:
        raise AudioError(
            f"{name} holds {1000 * max(count, 0) / sr:.0f} ms after the onset, less than {1000 * least / sr:.0f} ms",
            "all are read as far as the shortest: leave it out, or give the whole",
        )
