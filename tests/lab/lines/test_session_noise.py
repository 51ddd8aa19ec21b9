"""What stands before the onsets and in the tails of a session's takes is noise, however narrow it is."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.lines.session_noise import session_floor, tone_power, without_loud_noise
from sonic_bullet.records import Array
from sonic_bullet.signal.log_spectral import Floor

SR = 16_000
START = SR // 2
TIME = np.arange(2 * SR) / SR


def takes(beside: Array, struck: Array, count: int = 5) -> list[Array]:
    rng = np.random.default_rng(3)
    return [1e-3 * rng.standard_normal(len(TIME)) + beside + struck * (TIME >= 0.5) for _ in range(count)]


def at(floor: Floor, hz: float) -> float:
    return float(floor.variance[round(hz / (SR / 2) * (len(floor.variance) - 1))])


def test_a_tone_that_stands_is_noise_and_one_that_was_struck_is_not() -> None:
    fan, bar = (0.01 * np.sin(2 * np.pi * f * TIME) for f in (1000.0, 3000.0))
    floor = session_floor(takes(fan, bar), SR, [START] * 5)
    assert floor is not None
    assert at(floor, 1000.0) > 100 * at(floor, 2000.0)
    assert at(floor, 3000.0) == pytest.approx(at(floor, 2000.0), rel=0.5)
    assert at(floor, 2000.0) == pytest.approx(1e-6, rel=0.5)


def test_noise_that_ends_with_the_onset_or_stands_before_few_takes_is_none() -> None:
    tone = 0.01 * np.sin(2 * np.pi * 1000.0 * TIME)
    before = session_floor(takes(tone * (TIME < 0.5), 0 * TIME), SR, [START] * 5)
    assert before is not None and at(before, 1000.0) < 3e-6
    some = takes(0 * TIME, 0 * TIME)
    some[0] = some[0] + tone
    assert (found := session_floor(some, SR, [START] * 5)) is not None and at(found, 1000.0) < 3e-6
    assert session_floor(some, SR, [100] * 5) is None


def test_a_tone_has_its_own_power() -> None:
    bins = 2049
    window = np.hanning(2 * (bins - 1))
    hz = 512 * SR / (2 * (bins - 1))
    tone = 0.3 * np.cos(2 * np.pi * hz * np.arange(len(window)) / SR)
    power = np.abs(np.fft.rfft(tone * window)) ** 2 / (window**2).sum()
    assert tone_power(Floor(power), np.array([hz]), SR)[0] == pytest.approx(0.09, rel=1e-3)


def test_filtered_noise_is_white_and_onsets_stay() -> None:
    low = np.cumsum(np.random.default_rng(1).standard_normal(len(TIME)))
    low -= np.convolve(low, np.ones(400) / 400, "same")
    floor = session_floor([low] * 3, SR, [START] * 3)
    assert floor is not None
    click = np.zeros(len(TIME))
    click[START] = 1.0
    heard = without_loud_noise(click, floor)
    assert np.abs(heard[START - 200 : START]).max() < 1e-2 * np.abs(heard).max()
    assert np.argmax(np.abs(heard)) == START
    left = np.abs(np.fft.rfft(without_loud_noise(low, floor))) ** 2
    assert left[100:400].mean() < 3 * left[8000:12000].mean()
