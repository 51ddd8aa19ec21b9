"""Twelve made bars, one with a notch, one with another damping: the two are named, no other."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.lab.states.odd_pieces import find_odd_pieces, find_odd_shapes
from tests.lab.states.made_bars import bar_modes, bars
from tests.lab.states.made_pieces import pieces


@pytest.mark.slow
def test_the_notched_and_the_damped_bar_are_named_and_no_other() -> None:
    found = find_odd_pieces(bars(0))
    assert found is not None
    assert [(one.name, one.verdict) for one in found.odd] == [("bar05", "shape"), ("bar10", "damping")]
    assert found.odd[1].t60_ratio == pytest.approx(1 / 1.6, rel=0.1)


def test_of_twelve_bars_by_our_own_modes_the_notched_and_the_damped_are_named_and_no_other() -> None:
    found = find_odd_pieces(pieces(0))
    assert found is not None and len(found.line_hz) >= 8
    assert [(one.name, one.verdict) for one in found.odd] == [("bar05", "shape"), ("bar10", "damping")]
    assert found.odd[1].t60_ratio == pytest.approx(1 / 1.6, rel=0.1)


def _bars_hz(seed: int, notched: bool) -> np.ndarray:
    """Lines of eight bars by closed form, each bar's in their order: where they cross, another family's."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(8):
        size = np.array([0.20, 0.025, 0.008]) * (1 + 0.01 * rng.standard_normal(3))
        notch = (0.37, 0.004, 0.35 if notched and k == 3 else 0.0)
        rows.append(bar_modes(tuple(size), 7850 * (1 + 0.01 * rng.standard_normal()), notch)[0][:11])
    return np.log(rows) + 5e-5 * rng.standard_normal((8, 11))


def test_lines_that_cross_make_no_bar_odd_and_hide_no_notch() -> None:
    for seed in range(3):
        assert find_odd_shapes(_bars_hz(seed, notched=False))[0].min() > 0.01
        chance = find_odd_shapes(_bars_hz(seed, notched=True))[0]
        assert chance[3] <= 0.01 < np.delete(chance, 3).min()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 5))
def test_other_takes_and_places_of_the_same_bars_name_no_other(seed: int) -> None:
    found = find_odd_pieces(pieces(seed))
    assert found is not None
    named = {(one.name, one.verdict) for one in found.odd}
    assert ("bar10", "damping") in named and named <= {("bar05", "shape"), ("bar10", "damping")}


@pytest.mark.slow
def test_none_is_named_of_our_own_bars_that_scatter_alone() -> None:
    found = find_odd_pieces(pieces(0, notched=False, damped=False))
    assert found is not None and found.odd == ()


@pytest.mark.slow
def test_none_is_named_of_bars_that_scatter_alone() -> None:
    found = find_odd_pieces(bars(1, notched=None, damped=None))
    assert found is not None and found.odd == ()


def test_five_pieces_are_too_few() -> None:
    assert find_odd_pieces(bars(0, count=5, takes=1)) is None
