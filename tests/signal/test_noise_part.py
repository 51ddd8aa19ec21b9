"""Noise beside lines, measured of takes whose noise is drawn anew each time, comes back by its levels."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.signal.band_time import THIRDS_HZ, band_time, level_distance_db
from sonic_bullet.signal.noise_part import noise_beside_lines, with_noise_part

SR = 22_050
TIME = np.arange(SR) / SR


def line(strength: float = 1.0) -> np.ndarray:
    return strength * 0.3 * np.exp(-8 * TIME) * np.cos(2 * np.pi * 630 * TIME)


def hiss(seed: int, strength: float = 1.0) -> np.ndarray:
    """White noise that falls by e in 1/15 s."""
    return strength * 0.05 * np.random.default_rng(seed).standard_normal(SR) * np.exp(-15 * TIME)


def test_levels_of_a_hiss_come_back_beside_a_line_that_hides_it() -> None:
    takes = [band_time(line() + hiss(seed), SR) for seed in range(8)]
    noise = noise_beside_lines(takes, [band_time(line(), SR)])
    early = noise.power[:, :8].mean(axis=1)
    # a third of an octave holds its width of white noise: 0.05² · 0.23 f/(SR/2), over 64 ms
    fall = (1 - np.exp(-30 * 0.064)) / (30 * 0.064)
    wanted = 0.05**2 * fall * THIRDS_HZ[: len(early)] * (2 ** (1 / 6) - 2 ** (-1 / 6)) / (SR / 2)
    beside = np.abs(np.log2(THIRDS_HZ[: len(early)] / 630)) > 1
    high = beside & (THIRDS_HZ[: len(early)] > 1000)
    assert np.abs(10 * np.log10(early[high] / wanted[high])).max() < 1.5


def test_a_take_held_out_is_as_near_as_another_and_far_without_the_noise() -> None:
    takes = [band_time(line() + hiss(seed), SR) for seed in range(4)]
    held, lines = band_time(line() + hiss(9), SR), band_time(line(), SR)
    made = with_noise_part(lines, noise_beside_lines(takes, [lines]))
    other = min(level_distance_db(take, held) for take in takes)
    assert level_distance_db(made, held) < 1.1 * other < 0.5 * level_distance_db(lines, held)


def test_noise_goes_with_the_strength_of_a_strike() -> None:
    strength = np.array([0.5, 1.0, 3.0])
    takes = [band_time(line(s) + hiss(k, s), SR) for k, s in enumerate(strength)]
    played = [band_time(line(s), SR) for s in strength]
    unit = noise_beside_lines(takes, played, strength)
    alike = [band_time(line() + hiss(k), SR) for k in range(3)]
    again = noise_beside_lines(alike, [band_time(line(), SR)] * 3, np.ones(3))
    assert unit.power == pytest.approx(again.power, rel=1e-6, abs=1e-9 * again.power.max())
    strong = with_noise_part(band_time(line(2.0), SR), unit, 2.0)
    assert strong.power == pytest.approx(4 * with_noise_part(band_time(line(), SR), unit).power, rel=1e-6)


def test_lines_alone_leave_no_noise() -> None:
    takes = [band_time(line(), SR)] * 2
    assert noise_beside_lines(takes, takes[:1]).power.max() == 0.0
