"""Whether a take stands at its peak: a fit of it would be of the limiter."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError

CLIPPED = 8  # samples in a row at the file's peak
CLIPPED_RUNS = 4  # or as many rows of three: a sound that decays has one highest peak


def refuse_clipped(sound: Array, name: object) -> None:
    """Raise AudioError where a channel stands at its peak."""
    peak = float(np.abs(sound).max())
    runs = np.convolve(np.abs(sound) >= 0.9999 * peak, np.ones(CLIPPED), "valid")
    rows = np.convolve(np.abs(sound) >= (1 - 1e-6) * peak, np.ones(3), "valid") > 2.5
    flat = int((np.diff(rows.astype(np.int8), prepend=0) > 0).sum())
    if (len(runs) and runs.max() >= CLIPPED) or flat >= CLIPPED_RUNS:
        raise AudioError(
            f"{name} is clipped: rows of samples stand at its peak",
            "leave it out, or record at a lower level; a fit of it would be of the limiter",
        )
