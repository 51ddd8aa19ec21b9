"""Filters of loudness and true peak beside SciPy's, which take a second to load and so are not used."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest
from pyloudnorm import Meter
from scipy.signal import firwin, resample_poly, sosfilt

from sonic_bullet.files.loudness import meter, true_peak
from sonic_bullet.files.storage.spooled_sound import KeptSound


class Blocks:
    """A sound that comes in blocks of uneven length, one of a single sample."""

    def __init__(self, x: np.ndarray) -> None:
        self.x, self.shape = x, x.shape

    def blocks(self) -> list[np.ndarray]:
        return np.split(self.x, [1, 700, 4100], axis=1)


@pytest.mark.parametrize("sr", [8000, 44_100, 96_000])
def test_energy_is_that_of_a_filter_run_over_all_at_once(sr: int) -> None:
    x = np.random.default_rng(1).standard_normal((2, sr // 2)) * np.linspace(0, 1, sr // 2)
    stages = Meter(sr)._filters.values()
    sections = np.array([np.concatenate([stage.passband_gain * stage.b, stage.a]) for stage in stages])
    assert meter.k_weighting(sr) == pytest.approx(sections, abs=1e-14)
    filtered = sosfilt(sections, x, axis=1)
    blocks = np.arange(x.shape[1]) * 10 // sr
    wanted = np.bincount(blocks, (filtered**2).sum(axis=0)) * 10 / sr
    assert meter._block_energy(cast(KeptSound, Blocks(x)), sr) == pytest.approx(wanted, rel=1e-9)


def test_samples_between_samples_are_those_of_a_windowed_sinc() -> None:
    x = np.random.default_rng(2).standard_normal((2, 500))
    window = firwin(641, 1 / 16, window=("kaiser", true_peak.KAISER_BETA))
    assert true_peak._interpolate_samples(x) == pytest.approx(resample_poly(x, 16, 1, axis=1, window=window), abs=1e-13)
