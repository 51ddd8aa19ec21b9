"""Loudness against the standard's own numbers, and grids of frequency there and back."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.signal.perceptual.loudness import bark, bark_to_hz, loudness, phon, sone


def test_loudness_of_one_kilohertz() -> None:
    # by definition; the standard's own formula is 0.04 phon off at its pivot
    assert sone(phon(np.array([40.0, 60.0, 80.0]), 1000.0)) == pytest.approx([1, 4, 16], rel=4e-3)
    assert loudness(0.5e-4, 1000.0, 94.0) == pytest.approx(2 ** ((94 - 43.01 - 40) / 10), rel=4e-3)


def test_contour_of_the_standard() -> None:
    # ISO 226:2003, annex B, the 40 phon contour, and the threshold at its first and last frequency
    freq_hz = np.array([20, 31.5, 50, 100, 200, 500, 1000, 2000, 3150, 5000, 8000, 12500])
    level_db = np.array([99.9, 88.2, 77.8, 64.4, 53.4, 43.1, 40.0, 39.2, 35.6, 40.0, 51.8, 51.5])
    # the standard's two equations, levels of phon and phon of levels, are rounded 0.06 phon apart
    assert (phon(level_db - 0.06, freq_hz) < 40.06).all() and (phon(level_db + 0.06, freq_hz) > 39.94).all()
    assert phon(np.array([78.5, 12.3]), np.array([20.0, 12500.0])) == pytest.approx([2.4, 2.4], abs=0.1)


def test_loudness_grows_without_a_step() -> None:
    level = np.linspace(-60, 160, 4001)
    for freq_hz in (20.0, 440.0, 3150.0, 16000.0):
        grown = np.diff(sone(phon(level, freq_hz)))
        assert (grown >= 0).all()
    assert sone(40 - 1e-9) == pytest.approx(float(sone(40 + 1e-9)), rel=1e-8)


def test_bark_there_and_back() -> None:
    freq_hz = np.array([20.0, 600.0, 20000.0])
    assert bark_to_hz(bark(freq_hz)) == pytest.approx(freq_hz)
    assert bark(600.0) == pytest.approx(6 * np.log(1 + np.sqrt(2)))
