"""The plain ways to write a bank in Python: frames of 200 samples of modes that ring, processor time of this thread."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from benchmarks.peers.tools import SR, spread_modes
from sonic_bullet.records import Array

FRAME = 200


def best_s(run: Callable[[], object], repeats: int) -> float:
    """Least processor time of some runs, s."""
    times = []
    for _ in range(repeats):
        begin = time.thread_time()
        run()
        times.append(time.thread_time() - begin)
    return min(times)


def _log_poles(count: int) -> Array:
    hertz, ring_s = spread_modes(count)
    return np.asarray((-np.log(1000) / ring_s + 2j * np.pi * hertz) / SR)


def _sustained(count: int, frames: int, spent_s: float) -> float:
    return count * frames * FRAME / SR / max(spent_s, 1e-9)


def by_lfilter(scale: float = 1.0) -> float:
    """scipy's filter, one a mode: modes that one core keeps ringing in real time."""
    count = max(2, int(300 * scale))
    pole = np.exp(_log_poles(count))
    memory, silence = np.stack([pole.real, -(np.abs(pole) ** 2)], axis=1), np.zeros(FRAME)

    def run() -> None:
        out = np.zeros(FRAME)
        for m in range(count):
            sound, memory[m] = lfilter([1.0], [1.0, -2 * pole[m].real, abs(pole[m]) ** 2], silence, zi=memory[m])
            out += sound

    return _sustained(count, 1, best_s(run, 3))


def by_outer(scale: float = 1.0) -> float:
    """numpy's exponential of an outer product, modes by samples."""
    count = max(2, int(300 * scale))
    s = _log_poles(count)
    spent = best_s(lambda: np.exp(np.multiply.outer(s, np.arange(FRAME))).real.sum(axis=0), 3)
    return _sustained(count, 1, spent)
