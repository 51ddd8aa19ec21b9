"""Robust losses, fits and windows against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.signal.exponential_law import mean_by_median, mean_by_quartile
from sonic_bullet.signal.peaks import local_peaks
from sonic_bullet.signal.robust import cauchy_loss, cauchy_weight, fit_nonnegative, normal_sd, weighted_median
from sonic_bullet.signal.short_time import (
    filter_circular,
    positive_hann,
    power_spectrum,
    raised_cosine,
    short_time_spectra,
)


def test_a_weight_is_the_losses_slope_over_the_residual() -> None:
    z, step, scale = np.linspace(0.1, 20, 50), 1e-5, 2.5
    loss = [cauchy_loss(((z + side) / scale) ** 2, scale**2) for side in (-step, step)]
    assert (loss[1] - loss[0]) / (2 * step) / (2 * z) == pytest.approx(cauchy_weight((z / scale) ** 2), rel=1e-6)


def test_a_tenth_of_outliers_does_not_move_a_line() -> None:
    x = np.linspace(0, 1, 30)
    y = 2 + 3 * x
    y[::10] += 40.0
    value, left = fit_nonnegative(y, np.full(30, 0.01), np.stack([np.ones(30), x], axis=1))
    assert value == pytest.approx([2, 3], rel=0.02)
    assert left[::10].min() > 1000 * left[1::10].max()


def test_standard_deviations_and_means_of_noise_come_from_its_quantiles() -> None:
    rng = np.random.default_rng(0)
    normal, power = 0.7 * rng.standard_normal((2, 200_000)), 5.0 * rng.exponential(size=(2, 200_000))
    normal[:, :2000], power[:, :2000] = 1e6, 1e9
    assert normal_sd(normal, 1) == pytest.approx(0.7, rel=0.03)
    assert mean_by_median(power, 1) == pytest.approx(5.0, rel=0.03)
    assert mean_by_quartile(power, 1) == pytest.approx(5.0, rel=0.03)


def test_a_weighted_median_is_that_of_repeated_values() -> None:
    value, weight = np.array([4.0, 1.0, 9.0, 2.0]), np.array([2, 1, 3, 1])
    assert weighted_median(value, weight.astype(float)) == np.median(np.repeat(value, weight))


def test_power_is_parsevals_and_a_window_may_be_any() -> None:
    x = np.random.default_rng(2).standard_normal((3, 501))
    power = power_spectrum(x, positive_hann(501), 1001)
    assert power[:, 0] + 2 * power[:, 1:].sum(axis=1) == pytest.approx(
        1001 * ((x * positive_hann(501)) ** 2).sum(axis=1)
    )
    assert (short_time_spectra(x, np.hanning(64), 16) == short_time_spectra(x, 64, 16)).all()


def test_a_fade_and_its_reverse_sum_to_one() -> None:
    t = np.linspace(-0.2, 1.2, 200)
    assert raised_cosine(t) + raised_cosine(1 - t) == pytest.approx(np.ones(200))


def test_a_filter_is_its_taps_convolution_where_zeros_leave_room() -> None:
    rng = np.random.default_rng(3)
    x, taps, size = rng.standard_normal(300), rng.standard_normal(40), 340
    assert filter_circular(x, np.fft.rfft(taps, size), size)[:339] == pytest.approx(np.convolve(x, taps), abs=1e-12)


def test_peaks_are_those_of_a_cosine_and_the_ends_are_none() -> None:
    t = np.arange(0, 401) / 100
    assert local_peaks(np.cos(2 * np.pi * t)).tolist() == [100, 200, 300]
    assert local_peaks(np.array([0.0, 1.0, 1.0, 0.0])).tolist() == [2]
