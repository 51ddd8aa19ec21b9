"""Which modes are kept: by energy, and by what hides what."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.bake.mode_importance import important_modes, masked_modes, mode_energy
from tests.made.models import box_surface


def test_energy_of_a_body_that_moves_as_a_whole_is_that_of_its_faces() -> None:
    """A cube's translation along x: <|φ·n|²> is one third of φ²; ∫p² of a decaying sine is |p|²φ²/4d."""
    vertex, face = box_surface([0.1, 0.1, 0.1])
    shape = np.zeros((len(vertex), 3, 1))
    shape[:, 0] = 5.0
    energy = mode_energy(vertex, face, shape, np.array([2.0j]), np.array([3.0]))
    assert energy == pytest.approx([25 / 3 * 4 / (4 * 3)])


def test_a_weak_neighbour_is_masked_only_while_its_masker_rings() -> None:
    freq, energy = np.array([1000.0, 1050.0, 9000.0]), np.array([1.0, 1e-4, 1e-4])
    assert masked_modes(freq, np.array([2.0, 5.0, 5.0]), energy).tolist() == [False, True, False]
    assert masked_modes(freq, np.array([5.0, 2.0, 2.0]), energy).tolist() == [False, False, False]


@pytest.mark.parametrize("gap_bark", [-1.5, -0.5, 0.0, 1.0, 3.0])
def test_the_threshold_is_the_spreading_function(gap_bark: float) -> None:
    masker_bark = 8.0
    freq = 600 * np.sinh(np.array([masker_bark, masker_bark + gap_bark]) / 6)
    x = gap_bark + 0.474
    threshold_db = 15.81 + 7.5 * x - 17.5 * np.sqrt(1 + x * x) - 14.5 - masker_bark
    for off_db, hidden in ((-0.1, True), (0.1, False)):
        energy = np.array([1.0, 10 ** ((threshold_db + off_db) / 10)])
        assert masked_modes(freq, np.ones(2), energy)[1] == hidden


def test_order_count_and_level() -> None:
    freq, decay, energy = np.array([200.0, 900.0, 4000.0, 9000.0]), np.ones(4), np.array([1e-3, 1.0, 0.1, 1e-7])
    assert important_modes(freq, decay, energy).tolist() == [1, 2, 0, 3]
    assert important_modes(freq, decay, energy, most=2).tolist() == [1, 2]
    assert important_modes(freq, decay, energy, below_db=50).tolist() == [1, 2, 0]
    assert important_modes(freq, decay, energy, below_db=20).tolist() == [1, 2]
