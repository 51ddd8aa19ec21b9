"""The gain of least distance: the least of all, and never farther than silence."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.fit.takes.best_gain import distance_at, find_best_gain
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import power_spectra, white
from tests.few_cases import parametrize_few

SR = 16_000
NOISE = 1e-3
T = np.arange(SR) / SR


def ring(*modes: tuple[float, float, float]) -> Array:
    """Damped cosines (n,) of frequency in Hz, decay in 1/s and amplitude."""
    return np.asarray(sum(a * np.exp(-d * T) * np.cos(2 * np.pi * f * T) for f, d, a in modes))


def taken(sound: Array, seed: int = 1) -> Array:
    return sound + NOISE * np.random.default_rng(seed).standard_normal(len(sound))


RECORDED = ((440.0, 6.0, 0.3), (1730.0, 20.0, 0.1))
PLAYED = {
    "the same": RECORDED,
    "one mode of two": ((440.0, 6.0, 1.0),),
    "two levels that fit two modes": ((440.0, 6.0, 1.0), (1730.0, 20.0, 1e-4)),
    "another body": ((3100.0, 15.0, 1.0), (5200.0, 30.0, 0.5)),
    "too long": ((440.0, 0.5, 1.0), (1730.0, 1.0, 0.2)),
}


@pytest.mark.parametrize("name", PLAYED)
@parametrize_few("level", [1e-6, 1.0, 1e5], (1,))
def test_no_gain_of_a_dense_grid_is_nearer_and_silence_is_not(name: str, level: float) -> None:
    power, made = power_spectra(taken(ring(*RECORDED))), power_spectra(level * ring(*PLAYED[name]))
    floor = white(NOISE)
    found = find_best_gain(power, made, floor)
    grid = np.concatenate([[0.0], 10 ** (np.arange(-120, 60, 0.5) / 20) / level])
    least = min(d for g in grid if np.isfinite(d := distance_at(power, made, floor, float(g))))
    assert found.distance_db <= distance_at(power, made, floor, 0.0)
    assert found.distance_db <= least + 0.05


def test_a_tone_that_is_not_there_is_best_not_heard() -> None:
    """Beside a tone that hardly stands above the noise: any gain at which the other counts is farther."""
    power, other = power_spectra(taken(ring((440.0, 0.0, 2.5e-4)))), power_spectra(ring((3000.0, 0.0, 1.0)))
    found, silence = find_best_gain(power, other, white(NOISE)), distance_at(power, other, white(NOISE), 0.0)
    assert found.gain == 0 and found.distance_db == silence


@pytest.mark.parametrize("level", [1e-3, 0.3, 70.0])
def test_another_take_of_the_same_is_found_at_its_gain(level: float) -> None:
    power, made = power_spectra(taken(ring(*RECORDED))), power_spectra(level * taken(ring(*RECORDED), 2))
    found = find_best_gain(power, made, white(NOISE), recorded=True)
    assert found.gain == pytest.approx(1 / level, rel=0.05)


def test_nothing_played_is_silence() -> None:
    power = power_spectra(taken(ring(*RECORDED)))
    found = find_best_gain(power, power_spectra(np.zeros(SR)), white(NOISE))
    assert found.gain == 0 and np.isfinite(found.distance_db)


def test_nothing_over_the_noise_has_no_distance() -> None:
    found = find_best_gain(power_spectra(np.full(SR, 1e-9)), power_spectra(np.zeros(SR)), white(NOISE))
    assert np.isnan(found.distance_db)
