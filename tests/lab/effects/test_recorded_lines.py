"""Recorded lines in the place of a body's modes: their own frequencies and decays, at the body's own level."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.effects.presets_of_effects import effect_of, to_preset
from sonic_bullet.effects.recorded_lines import RecordedLines, _loudness, _vertex_normals
from sonic_bullet.files.presets import load_material
from sonic_bullet.modal import analyse
from sonic_bullet.records import ModalModel, Shape
from sonic_bullet.records.errors import RecordError

LINES = RecordedLines((500.0, 1400.0, 3100.0), (5.0, 12.0, 40.0), (1.0, 0.5, 0.1), (0.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def bar() -> ModalModel:
    return analyse((Shape("box", size_m=np.array([0.12, 0.02, 0.008])),), load_material("steel"), to_hz=8000)


def loudness(model: ModalModel) -> np.ndarray:
    normal, area = _vertex_normals(model)
    moved = np.einsum("vxm,vx->vm", model.shape.astype(float), normal)
    return _loudness(model.freq_hz, moved, area, float(np.sqrt(area.sum() / (4 * np.pi))))


def test_frequencies_and_decays_are_those_recorded(bar: ModalModel) -> None:
    made = LINES.apply(bar)
    assert np.array_equal(made.freq_hz, LINES.freq_hz) and np.array_equal(made.decay_per_s, LINES.decay_per_s)
    assert made.includes_radiation


def test_levels_stand_to_each_other_as_recorded_and_the_energy_is_the_bodys(bar: ModalModel) -> None:
    made = LINES.apply(bar)
    size = loudness(made)
    assert np.allclose(size / size[0], np.array(LINES.amplitude), rtol=1e-5)
    energy = [(loudness(m) ** 2 / (4 * m.decay_per_s)).sum() for m in (made, bar)]
    assert np.isclose(energy[0], energy[1], rtol=1e-5)


def test_a_spread_from_strike_to_strike_is_one_from_place_to_place(bar: ModalModel) -> None:
    made = RecordedLines(LINES.freq_hz, LINES.decay_per_s, LINES.amplitude, (0.0, 3.0, 6.0)).apply(bar)
    size = 20 * np.log10(np.linalg.norm(made.shape.astype(float), axis=1))
    assert np.allclose(size.std(axis=0), (0.0, 3.0, 6.0), atol=0.01)


def test_a_preset_keeps_them() -> None:
    assert effect_of(to_preset(LINES)) == LINES


@pytest.mark.parametrize(
    "fields",
    [
        ((), (), (), ()),
        ((500.0,), (5.0, 6.0), (1.0,), (0.0,)),
        ((500.0, 400.0), (5.0, 5.0), (1.0, 1.0), (0.0, 0.0)),
        ((float("nan"),), (5.0,), (1.0,), (0.0,)),
    ],
)
def test_lines_that_are_none_are_refused(fields: tuple[tuple[float, ...], ...]) -> None:
    with pytest.raises(RecordError):
        RecordedLines(*fields)
