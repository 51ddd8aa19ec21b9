"""Taps of d/dt: their derivation."""

from __future__ import annotations

import numpy as np

from sonic_bullet.engine.path.surface.sensor_chain import DIFFERENTIATOR_TAPS, differentiator


def test_taps_are_the_least_squares_of_the_relative_error() -> None:
    """To 0.85 of half the rate, at 400 frequencies [Oppenheim & Schafer 2010, sec. 7.5: type IV]."""
    omega = np.linspace(0.001, 0.85, 400) * np.pi
    lag = np.arange(DIFFERENTIATOR_TAPS // 2) + 0.5
    half = np.linalg.lstsq(2 * np.sin(omega[:, None] * lag) / omega[:, None], np.ones(len(omega)), rcond=None)[0]
    assert np.abs(differentiator(1) - np.concatenate([half[::-1], -half])).max() < 1e-12
