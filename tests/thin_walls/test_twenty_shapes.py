"""The truth of the twenty shapes: carried on from three degrees as a closed form has it, kept in nested spaces."""

from __future__ import annotations

import numpy as np
import pytest

from studies.twenty_shapes import cad_truth, polynomials
from studies.twenty_shapes.catalogue import ENTRIES

DEGREES = np.array(polynomials.DEGREES)[:, None]


@pytest.mark.parametrize("power", [2.2, 4.0, 8.0])
def test_a_power_of_the_degree_is_carried_on_to_its_limit(power: float) -> None:
    true = np.array([300.0, 4000.0])
    hertz = true * (1 + 0.3 * DEGREES**-power)
    found, fitted = polynomials.limit(hertz)
    np.testing.assert_allclose(found, true, rtol=2e-5)
    np.testing.assert_allclose(fitted, power, atol=0.03)
    np.testing.assert_allclose(polynomials.limit(hertz[:2], np.full(2, power))[0], true, rtol=1e-12)


def test_modes_that_no_degree_changes_are_their_own_limit() -> None:
    np.testing.assert_array_equal(polynomials.limit(np.full((3, 2), 440.0))[0], [440.0, 440.0])


def test_slower_than_a_crease_counts_as_a_crease() -> None:
    slow = 100 * (1 + 0.1 * DEGREES**-1.0)
    a, b = (float(p) ** -polynomials.CREASE for p in polynomials.DEGREES[1:])
    np.testing.assert_allclose(polynomials.limit(slow)[0], slow[2] - (slow[1] - slow[2]) * b / (a - b), rtol=1e-12)


@pytest.mark.parametrize("name", [name for name, kept in cad_truth.read().items() if "polynomials" in kept])
def test_each_degree_of_one_mesh_lies_below_the_one_before(name: str) -> None:
    for size in cad_truth.WIDER:
        kept = np.array(cad_truth.read()[name]["polynomials"][size]["frequency_hz"])
        assert (np.diff(kept, axis=0) <= 1e-6 * kept[1:]).all()


def test_each_truth_that_is_kept_is_of_a_shape_and_certain_to_a_share_of_itself() -> None:
    for name in cad_truth.read():
        assert name in {entry.truth for entry in ENTRIES.values()}
        limit = cad_truth.limit(name)
        assert (limit.frequency_hz > 0).all()
        assert (limit.uncertain < 0.05).all()
