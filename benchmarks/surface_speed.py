"""What share of real time do 100 rolling pairs cost on one core? Least of five half-second runs, in processor time.

python benchmarks/surface_speed.py
"""

from __future__ import annotations

import time

import numpy as np

from sonic_bullet.synth.surface import SurfaceLoads, SurfacePairs, SurfaceState, advance

P, SR, STEP = 100, 48000, 200
ONE = np.ones(P)
PAIRS = SurfacePairs(
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
    ends = [SurfaceLoads(0.033 * 9.81 * ONE * q, sweep * q) for q in (1.0, 1.01)]
    best, x = np.inf, np.arange(STEP) / STEP
    for _ in range(5):
        state, begin = SurfaceState.at_rest(P), time.process_time()
        for _ in range(120):
            _, state = advance(PAIRS, state, ends[0], ends[1], x, SR)
        best = min(best, (time.process_time() - begin) / 0.5)
    return best


share(1, 0.1)
for speed in (0.05, 0.5, 2.0):
    print(
        f"{speed:4.2f} m/s: rolling (two surfaces) {share(2, speed):.2f}, sliding (one surface) "
        f"{share(1, speed):.2f} of real time"
    )
print(f"at rest: {share(2, 0.0):.3f}")
