"""Lines that were read from a take's first peak on: what they are before it."""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.fit.prediction_of_lines import damped_sum, risen_sum

SR = 48_000
HZ, DECAY, AMPLITUDE = np.array([500.0, 15_000.0]), np.array([20.0, 2000.0]), np.array([0.3 + 0.1j, 40.0 - 3.0j])


def test_lines_rise_to_what_they_are_at_the_peak_and_go_on_as_they_are() -> None:
    """The fast one would have begun at 40, e⁸ times what it is at the peak after 4 ms."""
    rise = 192
    plain, risen = damped_sum(HZ, DECAY, AMPLITUDE, 4800, SR), risen_sum(HZ, DECAY, AMPLITUDE, 4800, SR, rise)
    assert np.array_equal(risen[rise:], plain[rise:])
    assert risen[0] == 0.0 and np.abs(plain[:rise]).max() > 30
    most = (np.abs(AMPLITUDE) * np.exp(-DECAY * rise / SR)).sum()
    assert np.abs(risen[:rise]).max() <= most
    assert abs(risen[rise - 1] - risen[rise]) < 0.2 * most


def test_lines_read_from_the_first_sample_on_are_as_they_are() -> None:
    assert np.array_equal(risen_sum(HZ, DECAY, AMPLITUDE, 480, SR, 0), damped_sum(HZ, DECAY, AMPLITUDE, 480, SR))
