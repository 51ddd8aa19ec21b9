"""Which modes are kept: by energy, and by what hides what."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.bake.mode_importance import (
    audible_order,
    important_modes,
    masked_modes,
    mode_energy,
    weigh_frequency,
)
from sonic_bullet.engine.contact.pulse_shape import pulse_spectrum
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
    assert important_modes(freq, decay, energy).tolist() == [1, 0, 2, 3]  # a soft mallet leaves the low octave alone
    assert important_modes(freq, decay, energy, below_db=50).tolist() == [1, 0, 2]
    assert important_modes(freq, decay, energy, below_db=20).tolist() == [1, 2]


def chime(count: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A free bar's modes, (2k + 1)²: the higher the louder, of an ideal impulse, and the sooner over."""
    freq = 260.0 * ((2 * np.arange(1, count + 1) + 1) / 3) ** 2
    freq = freq[freq < 20_000]
    return freq, 0.6 + 2e-7 * freq**2, freq**1.5


def octaves_db(freq: np.ndarray, decay: np.ndarray, energy: np.ndarray, at_s: float) -> np.ndarray:
    band = np.round(np.log2(freq / 1000)).astype(int)
    power = np.array([(energy * 4 * decay * np.exp(-2 * decay * at_s))[band == b].sum() for b in range(-3, 5)])
    return np.asarray(10 * np.log10(np.maximum(power, 1e-30)))


@pytest.mark.parametrize("count", [4, 6, 8])
def test_a_chime_keeps_its_pitch_and_what_rings_on(count: int) -> None:
    freq, decay, energy = chime()
    kept = important_modes(freq, decay, energy, most=count)
    assert 0 in kept  # its pitch, the weakest of an ideal impulse
    assert 0 not in np.argsort(-energy)[: len(freq) - 1]
    order, error_db = audible_order(freq, decay, energy)
    assert order[:count].tolist() == kept.tolist()
    assert len(error_db) == len(freq) + 1 and error_db[-1] == pytest.approx(0, abs=1e-9)
    assert error_db[0] > 50 and error_db[len(freq) - 1] < error_db[count]


def test_many_close_modes_are_thinned_by_what_is_heard() -> None:
    """A plate: 300 modes at random, of which 120 are within 3 dB by octave at the begin and after 0.5 and 1 s."""
    rng = np.random.default_rng(4)
    freq = np.sort(rng.uniform(100, 18_000, 300))
    decay, energy = 1 + 3e-8 * freq**2 + rng.uniform(0, 2, 300), rng.uniform(0.1, 1, 300) * freq
    kept = important_modes(freq, decay, energy, most=120)
    assert audible_order(freq, decay, energy)[1][120] < 3
    energy = energy * (weigh_frequency(freq) * pulse_spectrum(freq * 1e-4)) ** 2
    for at_s in (0.0, 0.5, 1.0):
        full, some = octaves_db(freq, decay, energy, at_s), octaves_db(freq[kept], decay[kept], energy[kept], at_s)
        heard = full > octaves_db(freq, decay, energy, 0.0).max() - 40
        assert (full - some)[heard].max() < 3
