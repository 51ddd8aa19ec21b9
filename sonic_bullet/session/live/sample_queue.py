"""Lock-free ring of samples between one thread that writes and one that takes.

    0 <= written − taken <= capacity

Each count is changed by one thread alone, after its samples are copied, so that the other thread may read it too low
but never too high (L. Lamport, "Specifying concurrent program modules", 1983).
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


class SampleQueue:
    """Queue of float32 samples (n, channels). written, taken: samples so far, of the writer and of the taker."""

    def __init__(self, channels: int, capacity: int) -> None:
        self._ring = np.zeros((capacity, channels), np.float32)
        self.written = self.taken = 0

    def write(self, samples: Array) -> int:
        """Append as many of samples (n, channels), or (n, 1) for all channels, as fit; return how many."""
        size = len(self._ring)
        count = min(len(samples), size - (self.written - self.taken))
        at = self.written % size
        head = min(count, size - at)
        self._ring[at : at + head] = samples[:head]
        self._ring[: count - head] = samples[head:count]
        self.written += count
        return count

    def take(self, out: Array) -> int:
        """Fill the first of out (n, channels) with the queued samples; return how many."""
        size = len(self._ring)
        count = min(len(out), self.written - self.taken)
        at = self.taken % size
        head = min(count, size - at)
        out[:head] = self._ring[at : at + head]
        out[head:count] = self._ring[: count - head]
        self.taken += count
        return count
