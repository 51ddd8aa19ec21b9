"""What share of real time do 100 rolling pairs cost on one core? Least of five half-second runs, in processor time.

    python studies/surface_speed.py

Pairs at rest are not among the voices of a step: they cost what a look at their rows does.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.made.surfaces import advance, surface_pairs

P, SR, STEP = 100, 48000, 200
ONE = np.ones(P)
PAIRS = surface_pairs(
    0.033 * ONE,
    5e10 * ONE,
    0.01 * ONE,
    0.25 * ONE,
    np.full((P, 2), 1e-6),
    np.full((P, 2), 0.75),
    np.arange(2 * P).reshape(P, 2),
)


def share(sides: int, speed_m_s: float) -> float:
    sweep = np.full((P, 2), speed_m_s)
    sweep[:, sides:] = 0
    load = 0.033 * 9.81 * ONE
    best, x = np.inf, np.arange(STEP) / STEP
    for _ in range(5):
        pairs, begin = PAIRS.copy(), time.process_time()
        for _ in range(120):
            advance(pairs, np.stack([load, 1.01 * load]), np.stack([sweep, 1.01 * sweep]), x, SR)
        best = min(best, (time.process_time() - begin) / 0.5)
    return best


share(1, 0.1)
for speed in (0.05, 0.5, 2.0):
    print(
        f"{speed:4.2f} m/s: rolling (two surfaces) {share(2, speed):.3f}, sliding (one surface) "
        f"{share(1, speed):.3f} of real time"
    )
