"""Short-time spectra and octaves against closed forms: a sine under a Hann window, white noise, Parseval."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ, octave_power
from sonic_bullet.signal.short_time import short_time_power, short_time_spectra, window_energy


def test_a_sine_on_a_bin_is_half_the_windows_sum() -> None:
    window, k = 512, 37
    signal = np.cos(2 * np.pi * k * np.arange(4096) / window)
    spectra = short_time_spectra(signal, window, 128)
    assert spectra.shape == ((4096 - window) // 128 + 1, window // 2 + 1)
    assert np.abs(spectra[:, k]) == pytest.approx(np.hanning(window).sum() / 2, rel=1e-4)
    assert np.abs(spectra[:, k + 4 :]).max() < 1e-2 * np.abs(spectra[:, k]).min()


def test_channels_are_each_as_alone() -> None:
    signal = np.random.default_rng(0).normal(size=(3, 5000))
    both = short_time_power(signal, 256, 64)
    assert all((both[i] == short_time_power(signal[i], 256, 64)).all() for i in range(3))


def test_power_over_the_windows_energy_is_the_variance_of_white_noise() -> None:
    signal = 0.3 * np.random.default_rng(1).normal(size=400_000)
    power = short_time_power(signal, 1024, 512) / window_energy(1024)
    assert power[:, 1:-1].mean() == pytest.approx(0.09, rel=0.01)


def test_octaves_share_a_spectrum_without_gap_or_overlap() -> None:
    freq = np.linspace(1, 30_000, 5000)
    power = np.random.default_rng(2).random((2, 5000))
    inside = (freq >= AUDIBLE_OCTAVES_HZ[0] / 2**0.5) & (freq < AUDIBLE_OCTAVES_HZ[-1] * 2**0.5)
    assert np.sum(octave_power(power, freq, AUDIBLE_OCTAVES_HZ), axis=0) == pytest.approx(power[:, inside].sum(axis=1))
