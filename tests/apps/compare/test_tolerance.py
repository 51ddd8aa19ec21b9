"""What passes within a tolerance, what does not, and what is said of it."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.compare.tolerance import SoundMeasures, as_tolerance, closeness, measure_sound
from sonic_bullet.records import Array
from sonic_bullet.records.errors import CompareError
from tests.few_cases import parametrize_few

SR = 48_000
TIME_S = np.arange(SR // 2) / SR


def ring(hz: float, start_s: float = 0.05) -> Array:
    since = np.maximum(TIME_S - start_s, 0)
    return np.exp(-20 * since) * np.sin(2 * np.pi * hz * since) * np.sin(np.pi / 2 * np.minimum(since / 0.02, 1)) ** 2


def measures(*sounds: Array) -> SoundMeasures:
    return measure_sound(np.sum(sounds, axis=0)[None], SR)


@parametrize_few(("gain_db", "within"), [(0.4, True), (-0.4, True), (0.6, False), (-0.6, False)], (0, 3))
def test_a_gain_is_within_its_decibels(gain_db: float, within: bool) -> None:
    found = closeness(measures(ring(1000)), measures(ring(1000) * 10 ** (gain_db / 20)), 0.5)
    assert found.within is within
    assert f"{abs(gain_db):.2g} dB {'louder' if gain_db > 0 else 'quieter'}" in found.words


def test_one_band_of_many_is_enough_to_fail() -> None:
    one = measures(ring(500), ring(4000))
    other = measures(ring(500), ring(4000) * 1.3)
    assert not closeness(one, other, 1.0).within
    assert "at 4000 Hz" in closeness(one, other, 1.0).words
    assert closeness(one, other, 20 * np.log10(1.3) + 0.01).within


def test_a_band_that_is_60_db_down_does_not_count() -> None:
    one, other = measures(ring(500), 1e-4 * ring(8000)), measures(ring(500), 2e-4 * ring(8000))
    assert closeness(one, other, 0.5).within


def test_another_event_fails_whatever_the_levels() -> None:
    one = measures(ring(1000))
    other = measures(ring(1000), 0.9 * ring(1000, 0.3))
    found = closeness(one, other, 60.0)
    assert not found.within
    assert "onsets 1 → 2" in found.words


def test_another_length_fails_and_silence_is_like_silence() -> None:
    x = ring(1000)
    assert "length" in closeness(measure_sound(x[None], SR), measure_sound(x[None, :-100], SR), 60.0).words
    still = measure_sound(np.zeros((1, SR)), SR)
    assert closeness(still, still, 0.0).within


@pytest.mark.parametrize("value", [-1.0, float("nan"), "much"])
def test_a_tolerance_is_decibels(value: object) -> None:
    with pytest.raises(CompareError, match="tolerance_db"):
        as_tolerance(value)
