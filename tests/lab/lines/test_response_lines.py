"""Modes of made frequency responses: exactly those that exist, each within its spread, however quiet the noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from sonic_bullet.lab.lines.line_values import Lines
from sonic_bullet.lab.lines.response_lines import response_lines
from sonic_bullet.records import Array

SR = 12_000


class Made(NamedTuple):
    at_hz: Array
    mobility: Array
    freq_hz: Array
    decay_per_s: Array


def made(
    seed: int,
    db: float,
    *,
    modes: int = 10,
    places: int = 5,
    to_hz: float = 6000.0,
    step_hz: float = 2.0,
    outside: int = 0,
    freq_hz: tuple[float, ...] = (),
) -> Made:
    """Accelerance Σ φ_s φ_0 ω²/(ω² − ω_k² − 2iζω_kω) with white noise of db below its peak, integrated to mobility."""
    rng = np.random.default_rng(seed)
    spread = 0.1 * to_hz + 0.82 * to_hz * (np.arange(modes) + rng.uniform(0.1, 0.9, modes)) / modes
    own = np.array(freq_hz) if freq_hz else spread
    loss = np.exp(rng.uniform(np.log(0.002), np.log(0.008), len(own)))
    every = np.concatenate([own, to_hz * rng.uniform(1.05, 2, outside)])
    every_loss = np.concatenate([loss, np.full(outside, 0.005)])
    shape = rng.normal(size=(places, len(every)))
    shape = np.sign(shape) * np.maximum(np.abs(shape), 0.3)  # no node: a mode is seen at every place
    at = np.arange(step_hz, to_hz + step_hz / 2, step_hz)
    w, omega = 2 * np.pi * every[:, None], 2 * np.pi * at
    accelerance = (shape * shape[0]) @ (omega**2 / (omega**2 - w**2 - 2j * every_loss[:, None] * w * omega))
    noise = rng.standard_normal((2, *accelerance.shape)) * 10 ** (db / 20) * np.abs(accelerance).max() / np.sqrt(2)
    mobility = (accelerance + noise[0] + 1j * noise[1]) / (1j * omega)
    return Made(at, mobility, own * np.sqrt(1 - loss**2), 2 * np.pi * own * loss)


def z_scores(one: Made, found: Lines) -> Array:
    return np.concatenate(
        [
            (found.freq_hz - one.freq_hz) / found.freq_sd_hz,
            (found.decay_per_s - one.decay_per_s) / found.decay_sd_per_s,
        ]
    )


@pytest.mark.parametrize("db", [-120.0, -90.0, -60.0])
@pytest.mark.parametrize(("modes", "places"), [(3, 3), (10, 5)])
def test_exactly_the_modes_that_exist(modes: int, places: int, db: float) -> None:
    scores = []
    for seed in (1, 2):
        one = made(seed, db, modes=modes, places=places)
        found = response_lines(one.mobility, one.at_hz, SR)
        assert len(found.freq_hz) == modes
        scores.append(z_scores(one, found))
    assert np.abs(np.concatenate(scores)).max() < 4.5


@pytest.mark.parametrize("db", [-120.0, -70.0])
def test_modes_above_the_band_are_no_lines_and_move_none(db: float) -> None:
    one = made(5, db, outside=3)
    found = response_lines(one.mobility, one.at_hz, SR)
    assert len(found.freq_hz) == 10
    assert np.abs(z_scores(one, found)).max() < 4.5


@pytest.mark.parametrize("db", [-120.0, -60.0])
def test_close_pairs_have_the_spread_that_they_scatter_by(db: float) -> None:
    """Half and one per cent apart, which is about what they are wide."""
    scores = []
    for seed in range(4):
        one = made(seed, db, places=4, freq_hz=(800.0, 804.0, 1700.0, 1717.0, 2900.0))
        found = response_lines(one.mobility, one.at_hz, SR)
        assert len(found.freq_hz) == 5, seed
        scores.append(z_scores(one, found))
    assert 0.7 < np.std(scores) < 1.35


def test_a_structure_is_read_as_a_bell_is() -> None:
    one = made(3, -70, modes=5, to_hz=200.0, step_hz=0.25)
    found = response_lines(one.mobility, one.at_hz, 1000)
    assert len(found.freq_hz) == 5
    assert np.abs(z_scores(one, found)).max() < 4.5


def test_a_quiet_last_sample_is_no_mode() -> None:
    """Noise at the band's edge is that of its neighbourhood, not of its last sample, which seed 31 has quiet."""
    for seed in (30, 31, 32):
        one = made(seed, -80, modes=2, places=1, step_hz=4.0)
        assert len(response_lines(one.mobility, one.at_hz, SR).freq_hz) == 2, seed


def test_noise_alone_has_no_mode() -> None:
    rng = np.random.default_rng(0)
    at = np.arange(2.0, 6001.0, 2.0)
    noise = (rng.standard_normal((3, len(at))) + 1j * rng.standard_normal((3, len(at)))) / (2j * np.pi * at)
    assert len(response_lines(noise, at, SR).freq_hz) == 0
