"""What does the sound path cost: 100 bodies that sound and move, two microphones, 48 kHz, steps of 1/240 s?

    python studies/path_speed.py

Prints shares of real time on one core (CPU time of this thread, best of several seconds), sounding and silent, and the
ratio to the plain way: scipy's cubic interpolation of each body's history at the retarded times.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from sonic_bullet.engine.path.propagation import append_bodies, empty_path
from sonic_bullet.records import Air

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from tests.made.paths import propagate

SR, FRAME, BODIES = 48_000, 200, 100
MICROPHONES = np.array([[0.0, -1.0, 0.5], [0.2, -1.0, 0.5]])


def ours(sounding: int) -> float:
    """Seconds of CPU per second of sound."""
    rng = np.random.default_rng(0)
    path, state = empty_path(SR, Air(), MICROPHONES)
    path, state = append_bodies(path, state, np.full(BODIES, 0.02))
    source, dipole = np.zeros((BODIES, FRAME)), np.zeros((BODIES, 3, FRAME))
    source[:sounding], dipole[:sounding] = rng.normal(size=(sounding, FRAME)), rng.normal(size=(sounding, 3, FRAME))
    place, progress, still = rng.uniform(-3, 3, (BODIES, 3)), np.arange(FRAME) / FRAME, np.zeros(BODIES, bool)
    times = []
    for repeat in range(6):
        begin = time.thread_time()
        for step in range(48):
            propagate(path, state, 48 * repeat + step, source, dipole, place, place + 0.01, still, progress)
        times.append((time.thread_time() - begin) * 5)
    return min(times)


def plain() -> float:
    """Seconds of CPU per second of sound: one body and microphone by cubic splines, times all of them."""
    rng = np.random.default_rng(0)
    history = rng.normal(size=FRAME + 1024)
    grid, late = np.arange(FRAME + 1024.0), 512.3 + 0.001 * np.arange(FRAME)
    begin = time.thread_time()
    for _ in range(48):
        CubicSpline(grid, history)(1024 + np.arange(FRAME) - late)
    return (time.thread_time() - begin) * 5 * BODIES * len(MICROPHONES)


def main() -> None:
    sounding, silent, splines = ours(BODIES), ours(0), plain()
    print(
        f"{BODIES} bodies x {len(MICROPHONES)} microphones sounding: {sounding:.1%} of real time; "
        f"silent: {silent:.2%}; cubic splines / ours: {splines / sounding:.0f}"
    )


if __name__ == "__main__":
    main()
