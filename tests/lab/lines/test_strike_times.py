"""Strikes are found at their times; what beats, decays twice, hums, hisses or comes back from a wall is none."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.lines.band_limit import limit_band
from sonic_bullet.lab.lines.linear_prediction import predicted_on
from sonic_bullet.lab.lines.onset import span
from sonic_bullet.records import Array

SR = 48_000
TIME = np.arange(SR) / SR
NOISE = 1e-4 * np.random.default_rng(0).standard_normal(SR)
STRUCK = ((1680.0, 3.0, 0.03), (4170.0, 12.0, 0.02), (7360.0, 25.0, 0.02))
BEATING = ((600.0, 3.0, 0.3), (611.0, 3.0, 0.3), (1500.0, 5.0, 0.3), (1527.0, 5.0, 0.3))
TWICE = ((900.0, 60.0, 0.3), (900.5, 2.0, 0.03), (2300.0, 90.0, 0.2), (2301.0, 3.0, 0.02))


def tap(at_s: float, modes: tuple[tuple[float, float, float], ...] = STRUCK) -> Array:
    u = np.maximum(TIME - at_s, 0)
    return np.asarray(sum(a * np.exp(-d * u) * np.sin(2 * np.pi * f * u) for f, d, a in modes))


@pytest.mark.parametrize(
    "sound",
    [
        tap(0.2),
        tap(0.0),
        tap(0.1, BEATING),
        tap(0.1, TWICE),
        tap(0.3) + 0.01 * np.sin(2 * np.pi * 50 * TIME),
        tap(0.3) + 30 * NOISE,
        1e3 * NOISE,
        sum(g * tap(0.2 + t) for t, g in ((0.0, 1.0), (0.004, 0.5), (0.011, 0.4), (0.023, 0.3), (0.031, 0.2))),
    ],
    ids=["single", "from the start", "beats", "double decay", "hum", "loud noise", "noise", "reflections"],
)
def test_no_second_strike_where_there_is_none(sound: Array) -> None:
    found = span(sound + NOISE, SR)
    assert found.hits == 1 and found.describe_hits(SR) == ""


@pytest.mark.parametrize("first_s", [0.0, 0.15, 0.4])
@pytest.mark.parametrize("noise", [1.0, 30.0])
def test_a_second_strike_a_fifth_of_a_second_later(first_s: float, noise: float) -> None:
    found = span(tap(first_s) + tap(first_s + 0.2) + noise * NOISE, SR)
    assert found.hits == 2
    assert found.later[0] / SR == pytest.approx(first_s + 0.2, abs=2e-3)


def test_a_band_passes_whole_and_nothing_of_what_is_outside() -> None:
    inside = 0.1 * np.sin(2 * np.pi * 1000 * TIME + 1)
    for outside_hz in (0.0, 50.0, 180.0, 9_200.0, 12_000.0):
        found = limit_band(inside + 0.2 * np.cos(2 * np.pi * outside_hz * TIME + 0.5), SR, (200.0, 8000.0))
        middle = slice(SR // 4, -SR // 4)
        assert np.abs(found - inside)[middle].max() < 1e-4


def test_tones_go_on_by_their_own_recursion() -> None:
    tones = np.cos(2 * np.pi * 900 * TIME + 0.4) + 0.5 * np.cos(2 * np.pi * 5100 * TIME)
    assert predicted_on(tones[:4800], 64, 480) == pytest.approx(tones[4800:5280], abs=0.02)
