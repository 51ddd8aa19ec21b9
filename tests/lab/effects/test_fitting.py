"""The optimiser of effects' numbers, against functions whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.effects.common.fitting import fit_numbers, search_number, search_numbers
from sonic_bullet.records import Array


def test_a_grid_is_refined_between_its_numbers_and_up_to_its_ends() -> None:
    grid = np.geomspace(0.1, 10, 9)
    for least in (0.1, 0.37, 3.3, 10.0):
        cost, found = search_number(lambda x, least=least: 1 + np.log(x / least) ** 2, grid)
        assert found == pytest.approx(least, rel=2e-4)
        assert cost == pytest.approx(1, abs=1e-6)
    for least in (-1.0, -0.2, 0.0, 0.77):  # numbers of both signs
        assert search_number(lambda x, least=least: (x - least) ** 2, np.linspace(-1, 1, 9))[1] == pytest.approx(
            least, abs=1e-3
        )


def test_a_simplex_ends_at_the_minimum_of_a_valley() -> None:
    cost, found = search_numbers(
        lambda x: float((1 - x[0]) ** 2 + 5 * (x[1] - x[0] ** 2) ** 2), np.zeros(2), np.full(2, 0.2), 400
    )
    assert found == pytest.approx([1, 1], abs=1e-3)
    assert cost < 1e-6


def test_one_decay_far_off_moves_no_law() -> None:
    """Under Cauchy's loss; fields that may be negative are fitted as they are, others in their logarithms."""
    omega, law = np.geomspace(1e3, 5e4, 20), DampingLaw("power", 4e-3, -0.4)
    decay = law.decay_per_s(omega)
    decay[7] *= 30

    def residual(one: DampingLaw) -> Array:
        return np.asarray(np.log(one.decay_per_s(omega) / decay) / 0.02)

    _, found = fit_numbers(DampingLaw("power", 1e-3, 0.5), ("eta", "exponent"), residual)
    assert found.eta == pytest.approx(4e-3, rel=2e-3)
    assert found.exponent == pytest.approx(-0.4, abs=2e-3)
