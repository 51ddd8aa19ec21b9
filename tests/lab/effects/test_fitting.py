"""The optimiser of effects' numbers, against functions whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.damping_law import DampingLaw
from sonic_bullet.lab.effects.common.fitting import fit_numbers, search_number, search_numbers, search_places
from sonic_bullet.records import Array
from tests.made.body import plate


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


def test_a_place_of_a_surface_is_found_with_a_number() -> None:
    x = plate()
    body = np.unique(x.face)
    goal = int(body[np.argmin(((x.vertex_m[body] - [0.06, 0.05, 0.0]) ** 2).sum(axis=1))])
    far = int(body[np.argmin(((x.vertex_m[body] - [0.02, 0.02, 0.0]) ** 2).sum(axis=1))])

    def trial(place: tuple[int, ...], number: Array) -> tuple[float, int, float]:
        off = float(np.linalg.norm(x.vertex_m[place[0]] - x.vertex_m[goal])) / 0.02
        return off**2 + (float(number[0]) - 1) ** 2, place[0], float(number[0])

    cost, place, number = search_places(trial, x, (far,), np.zeros(1), np.full(1, 0.3), 0.02, 120)
    assert place == goal
    assert number == pytest.approx(1, abs=0.01) and cost < 1e-4


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
