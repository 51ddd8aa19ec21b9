"""Lines that were read from a take's first peak on: what they are before it."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.fit.prediction_of_lines import damped_sum, lines_sound, risen_sum
from sonic_bullet.lab.fit.typical_strike import typical_strike
from sonic_bullet.lab.lines.line_values import Lines, struck_lines

SR = 48_000
HZ, DECAY = np.array([500.0, 15_000.0]), np.array([20.0, 2000.0])
AT_PEAK = np.array([0.3 + 0.1j, 0.01 - 0.002j])
RISE = np.array([192, 96])
"""Samples: taken back over 4 ms the fast one begins e⁸ times, 70 dB, above what it is at the peak."""


def lines() -> Lines:
    """Two takes of two lines that are the same at their first peaks."""
    one, sd = np.ones(2), np.full((2, 2), 1e-9)
    back = np.exp(np.outer(RISE / SR, DECAY))
    return Lines(HZ, DECAY, AT_PEAK * back, one, one, sd, 1e-6 * one, one, True, RISE / SR)


def test_lines_rise_to_what_they_are_at_the_peak_and_are_damped_from_there_on() -> None:
    for i, rise in enumerate(RISE):
        plain, risen = damped_sum(HZ, DECAY, lines().amplitude[i], 4800, SR), lines_sound(lines(), i, 4800, SR)
        assert np.allclose(risen[rise:], plain[rise:], rtol=0, atol=1e-12)
        assert risen[0] == 0.0 and np.abs(plain[:rise]).max() > np.abs(AT_PEAK).sum()
        assert np.abs(risen[:rise]).max() <= np.abs(AT_PEAK).sum()
        assert abs(risen[rise - 1] - risen[rise]) < 0.2 * np.abs(AT_PEAK).sum()


def test_lines_read_from_the_first_sample_on_are_as_they_are() -> None:
    expected = damped_sum(HZ, DECAY, AT_PEAK, 480, SR)
    assert np.array_equal(risen_sum(HZ, DECAY, AT_PEAK, 480, SR, 0), expected)


def test_a_line_is_judged_at_the_first_peak() -> None:
    """By what it would have been at the onset the fast one of the first take stands 30 times above all there is."""
    signals = np.stack([lines_sound(lines(), i, 4800, SR) for i in range(2)])
    assert np.abs(lines().amplitude[0, 1]) > 30 * np.abs(signals[0]).max()
    assert len(struck_lines(lines(), signals, 1.1).freq_hz) == 2  # it falls by 2 % until its next maximum
    assert struck_lines(lines(), 0.01 * signals, 10.0).freq_hz == pytest.approx([15_000.0])


def test_takes_that_rise_for_longer_are_the_same_strike() -> None:
    found = typical_strike(lines())
    assert np.abs(found.at_peak) == pytest.approx(np.abs(AT_PEAK), rel=1e-9)
    assert found.spread_db == pytest.approx([0.0, 0.0], abs=1e-9)


def test_lines_that_cancel_one_another_after_the_peak_do_so_before_it() -> None:
    """Each turned back at its own frequency, a heap of fast lines would stand far above all that was recorded."""
    rise, n = 60, 4800
    freq, decay = np.array([1000.0, 3000.0, 3400.0, 3800.0]), np.array([20.0, 2400.0, 2400.0, 2400.0])
    at_peak = np.array([0.1, 500.0, -1000.0, 500.1]) + 0j
    sound = risen_sum(freq, decay, at_peak * np.exp(-2j * np.pi * freq * rise / SR), n, SR, rise)
    after = damped_sum(freq, decay, at_peak, n - rise, SR)
    np.testing.assert_allclose(sound[rise:], after, atol=1e-9)
    assert 0 < np.abs(sound[:rise]).max() <= np.abs(after).max()
