"""Latencies of a run of any length in a fixed room: a count for every tenth of a millisecond."""

from __future__ import annotations

import numpy as np

BIN_S = 1e-4
BINS = 20_000  # two seconds: what is later counts as that


class Latencies:
    """How often which latency was met. worst_s: the longest, exactly; 0 before any."""

    def __init__(self) -> None:
        self._count = np.zeros(BINS, np.int64)
        self.worst_s = 0.0

    def add(self, latency_s: float) -> None:
        """One more."""
        self._count[min(max(int(latency_s / BIN_S), 0), BINS - 1)] += 1
        self.worst_s = max(self.worst_s, latency_s)

    def __len__(self) -> int:
        return int(self._count.sum())

    @property
    def median_s(self) -> float:
        """The middle of the median's bin; NaN where none was met."""
        if not len(self):
            return float("nan")
        return (int(np.searchsorted(np.cumsum(self._count), len(self) / 2)) + 0.5) * BIN_S
