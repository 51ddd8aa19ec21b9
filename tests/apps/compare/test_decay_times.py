"""T60 of a recording: of an exponential decay in closed form, wherever the recording ends."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.compare.outcome.sound_effects import t60_s

SR = 48_000


@pytest.mark.parametrize("length_s", [0.45, 0.5, 0.8, 2.0])
def test_the_time_of_decay_is_that_of_the_sound_however_long_it_is_recorded(length_s: float) -> None:
    """A second, of recordings that end 27 dB to 120 dB down."""
    n = np.arange(round(length_s * SR)) / SR
    sound = np.cos(2 * np.pi * 440 * n) * 10 ** (-3 * n)
    assert t60_s(sound[None], SR) == pytest.approx(1.0, rel=2e-3)


def test_what_does_not_fall_has_no_time_of_decay() -> None:
    assert t60_s(np.random.default_rng(3).normal(size=(1, SR)), SR) is None
    assert t60_s(np.zeros((1, SR)), SR) is None
