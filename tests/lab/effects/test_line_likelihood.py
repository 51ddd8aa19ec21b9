"""The likelihood of lines against its closed forms, and what outliers may not move."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.effects.common.line_likelihood import (
    DECAY_SCALE,
    decay_misfit,
    decay_residuals,
    fit_gain,
    fit_gains,
    misfit_about_constant,
)


@pytest.mark.parametrize("turn", [1.0, np.exp(0.7j)])
def test_a_gain_and_its_spread_are_those_of_least_squares_but_for_outliers(turn: complex) -> None:
    rng = np.random.default_rng(0)
    expected = turn * rng.uniform(0.5, 2.0, 400)
    sd = np.full(400, 0.05)
    observed = 3.0 * expected + 0.05 * turn * rng.standard_normal(400)
    found = fit_gain(observed, expected, sd, np.zeros(400), 1.0)
    assert found.gain == pytest.approx(3.0, abs=4 * found.sd)
    assert found.sd == pytest.approx(0.05 / np.linalg.norm(expected), rel=0.15)
    observed[::8] *= 20
    assert fit_gain(observed, expected, sd, np.zeros(400), 2.0).gain == pytest.approx(3.0, rel=2e-3)


def test_a_mode_as_loud_as_it_may_be_at_every_strike_costs_its_own_level_once() -> None:
    """Twenty strikes of four modes: one is 5 % louder at the sensor, whoever strikes."""
    mode = np.tile(np.arange(4), 20)
    expected, sd, rough = np.ones(80), np.full(80, 1e-2), np.zeros(80)
    observed = np.where(mode == 0, 1.05, 1.0)
    alone = fit_gain(observed, expected, sd, rough, 1.0)
    levelled = fit_gains(observed, expected[None], sd, rough[None], np.ones(1), mode)
    determinant = 4 * np.log1p(20 * (0.05 / 1e-2) ** 2)  # of Laplace's method, which has no other cost here
    assert levelled.misfit[0] - 80 * np.log(1e-4) - determinant == pytest.approx(1.0, abs=0.4)
    assert alone.misfit - 80 * np.log(1e-4) > 100


def test_gains_under_several_expectations_are_those_of_each_alone() -> None:
    rng = np.random.default_rng(3)
    expected = rng.uniform(0.1, 2, (5, 60))
    observed, sd, rough, start = (
        3 * expected[0] + rng.normal(0, 0.05, 60),
        np.full(60, 0.05),
        0.03 * expected,
        np.ones(5),
    )
    every = fit_gains(observed, expected, sd, rough, start)
    for i in range(5):
        alone = fit_gain(observed, expected[i], sd, rough[i], 1.0)
        assert (alone.gain, alone.sd, alone.misfit) == (every.gain[i], every.sd[i], every.misfit[i])


def test_decays_are_held_against_a_model_by_their_logarithms() -> None:
    decay, sd = np.array([10.0, 10.0, 10.0]), np.array([0.0, np.nan, np.inf])
    z = decay_residuals(decay, sd, np.full(3, 10 / np.exp(0.1)))
    assert z[:2] == pytest.approx([0.1 / 0.02, 0.1 / np.hypot(0.05, 0.02)]) and z[2] == pytest.approx(0, abs=1e-3)
    assert decay_misfit(decay, sd, np.full(3, 10 / np.exp(0.1))) == pytest.approx(
        DECAY_SCALE**2 * np.log1p((z / DECAY_SCALE) ** 2)
    )


def test_a_constant_costs_nothing_and_an_outlier_little() -> None:
    sd = np.full(9, 0.1)
    assert misfit_about_constant(np.full(9, -3.2), sd) == pytest.approx(0, abs=1e-9)
    off = np.full(9, -3.2)
    off[4] = 50.0
    assert misfit_about_constant(off, sd) == pytest.approx(9 * np.log1p((53.2 / 0.3) ** 2), rel=1e-3)
