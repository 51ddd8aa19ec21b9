"""A rolling ball keeps the measured laws through the whole chain; `studies/rolling_laws.py` prints the full tables.

Held here: 0.1 … 0.8 m/s, a board of 60 modes. n is not one number: a self-affine profile swept at v has a height of
κ^-(1+2H) at κ = f/v, so a heard mode's level goes with v^H; the contact's patch a takes √(v/(f a)) of what is shorter
than itself, so where the heard modes lie above v/a (1 kHz at 0.1 m/s) it goes with v^(H + ½) at most. Three seeds,
H = 0.7: 1.07 … 1.23 between the two slowest, 0.67 … 0.78 between the two fastest, 0.95 … 1.00 over all. Known to fail
and not tested: measured pairs have 0.5 … 0.96, which the ball passes by up to 0.04 over all, and where it is slow by
more; a sliding box has n = 1.0 … 1.1 where Bullet slides it calmly, and from 0.28 m/s on Bullet's chatter drowns
the rubbing.
"""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

BENCH: dict[str, Any] = runpy.run_path(str(Path(__file__).parents[1] / "studies" / "rolling_laws.py"))
SPEEDS, ROUGHNESS = np.geomspace(0.1, 0.8, 5), np.geomspace(0.3e-6, 5e-6, 5)
M = (0.63, 1.16)
"""Band of the exponent of level against roughness that was measured on real pairs."""


@pytest.mark.slow
def test_level_follows_speed_and_roughness_and_neither_law_hangs_on_the_other() -> None:
    logs = [BENCH["run"]("ball", v, 1.1, count=60) for v in SPEEDS]
    rms = np.full((5, 5), np.nan)
    for i in range(5):
        for j in range(5):
            if {i, j} & {0, 4}:  # all speeds at the extreme roughnesses, all roughnesses at the extreme speeds
                rms[i, j] = BENCH["observed"](logs[i], ROUGHNESS[j]).std()
    speed, rough = BENCH["law"](SPEEDS, rms.T[[0, 4]]), BENCH["law"](ROUGHNESS, rms[[0, 4]])
    hurst = {b.material.hurst for b in logs[0].bodies if b.material is not None}
    for law, (low, high) in ((speed, (min(hurst), max(hurst) + 0.5)), (rough, M)):
        assert law.least_r2 > 0.9
        assert low <= law.exponent.min() <= law.exponent.max() <= high, law
        assert np.ptp(law.exponent) <= 0.15, law
    slow, fast = (BENCH["law"](SPEEDS[half], rms.T[[0, 4]][:, half]) for half in (slice(0, 3), slice(2, 5)))
    assert (slow.exponent > fast.exponent).all(), (slow, fast)


def test_a_rolling_ball_has_no_line_at_the_step_rate() -> None:
    # the floor's modes would be lines of their own: what the steel ball radiates is smooth
    log = BENCH["run"]("ball", 0.15, 4.0, floor=None)
    rough = BENCH["observed"](log, 2e-6)
    own_noise = BENCH["observed"](log, 0.0)
    assert rough.std() > 100 * own_noise.std()  # 40 dB
    assert BENCH["excess_db"](rough, log.sr).max() <= 3.0
