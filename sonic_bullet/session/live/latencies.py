"""Histogram of latencies of fixed size: a count for every tenth of a millisecond."""

from __future__ import annotations

import numpy as np


class Latencies:
    """Counts of latencies. worst_s: the longest, exactly; 0 before any."""

    BIN_S = 1e-4

    LATENCY_BINS = 20_000  # two seconds: longer latencies count as that

    def __init__(self) -> None:
        self._count = np.zeros(self.LATENCY_BINS, np.int64)
        self.worst_s = 0.0

    def add(self, latency_s: float) -> None:
        """Count a latency."""
        self._count[min(max(int(latency_s / self.BIN_S), 0), self.LATENCY_BINS - 1)] += 1
        self.worst_s = max(self.worst_s, latency_s)

    def __len__(self) -> int:
        """Return the number of latencies."""
        return int(self._count.sum())

    @property
    def median_s(self) -> float:
        """Middle of the median's bin; NaN without any."""
        if not len(self):
            return float("nan")
        return (int(np.searchsorted(np.cumsum(self._count), len(self) / 2)) + 0.5) * self.BIN_S
