"""A shape solved once gives every size and isotropic material as a fresh solution does, and soon."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.dataset.impacts import OBJECTS
from sonic_bullet.presets import load_material
from sonic_bullet.radiation import far_field
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import ModalModel, Shape
from sonic_bullet.records.errors import ModalError
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.known_shapes import known_shape
from tests.few_cases import parametrize_few

AIR = sb.Air()
MATERIALS = ("steel", "glass", "wood", "aluminium")
WEDGE = Shape(
    "mesh",
    vertex_m=np.array([[0, 0, 0], [0.12, 0, 0], [0, 0.05, 0], [0.01, 0.01, 0.03]]) - 0.01,
    face=np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)


def resized(shape: Shape, size: float) -> Shape:
    return replace(shape, size_m=shape.size_m * size, vertex_m=shape.vertex_m * size)


def nearest_levels_db(model: ModalModel, fresh: ModalModel) -> np.ndarray:
    """Differences of third-octave radiated power per squared modal velocity, which pairs of modes may share."""
    levels = []
    for one, weight in ((model, radiation_of(model, AIR)[0]), (fresh, far_field.radiation(fresh, AIR)[0])):
        third = np.round(3 * np.log2(one.freq_hz / 1000)).astype(int)
        levels.append(np.bincount(third + 30, np.abs(weight) ** 2, 50))
    both = (levels[0] > 0) & (levels[1] > 0)
    return np.asarray(10 * np.log10(levels[0][both] / levels[1][both]))


@parametrize_few("name", ["square-plate", "bowl", "bar", "ring", "wedge"], 2)
@pytest.mark.parametrize(("size", "material"), [(1.0, "steel"), (0.6, "glass"), (1.3, "wood")])
def test_a_size_and_a_material_are_those_of_a_fresh_solution(name: str, size: float, material: str) -> None:
    shape = OBJECTS.get(name, WEDGE)
    known = known_shape(shape, MATERIALS, largest=1.3)
    model = known.model(size, material)
    fresh = analyse_body((resized(shape, size),), load_material(material), accuracy=0.001 if name != "wedge" else 0.005)
    count = min(model.mode_count, fresh.mode_count)
    assert abs(model.mode_count - fresh.mode_count) <= 1 and count > 5
    tolerance = 1e-3 if name != "wedge" else 5e-3  # whose elements are not as fine
    np.testing.assert_allclose(model.freq_hz[:count], fresh.freq_hz[:count], rtol=tolerance)
    np.testing.assert_allclose(model.decay_per_s[:count], fresh.decay_per_s[:count], rtol=3 * tolerance, atol=1e-3)
    assert model.mass_kg == pytest.approx(fresh.mass_kg, rel=1e-3)
    apart_db = nearest_levels_db(model, fresh)
    assert len(apart_db) > 3 and np.abs(apart_db).max() < 0.5
    rms = [np.sqrt((one.shape[:, :, :count].astype(float) ** 2).mean()) for one in (model, fresh)]
    assert rms[0] == pytest.approx(rms[1], rel=0.05)  # surfaces of other triangles


def test_a_size_is_the_scaling_law_itself() -> None:
    known = known_shape(OBJECTS["bowl"], ["steel"], largest=1.3)
    one, half = known.model(1.3, "steel"), known.model(0.65, "steel")
    m = half.mode_count
    np.testing.assert_allclose(half.freq_hz, 2 * one.freq_hz[:m], rtol=1e-5)
    np.testing.assert_allclose(half.shape, 2**1.5 * one.shape[:, :, :m], rtol=0, atol=2e-3 * half.shape.max())
    np.testing.assert_allclose(half.curvature_per_m, 2 * one.curvature_per_m)
    weight, damping = radiation_of(half, AIR)
    fresh_weight, fresh_damping = far_field.radiation(half, AIR)
    np.testing.assert_allclose(np.abs(weight), np.abs(fresh_weight), rtol=1e-2)
    np.testing.assert_allclose(damping, fresh_damping, rtol=2e-2)


def test_known_shapes_cost_what_was_asked() -> None:
    known = known_shape(OBJECTS["bowl"], MATERIALS, largest=1.3)
    known.model(1.0, "steel")
    start = time.process_time()
    for size in (0.6, 0.7, 0.8, 0.9, 1.1):
        known.model(size, "steel")
    assert (time.process_time() - start) / 5 < 0.05
    other = sb.Material.isotropic("made", youngs_pa=9e10, poisson=0.31, density_kg_m3=4000 + np.random.rand())
    start = time.process_time()
    known.model(1.0, other)
    assert time.process_time() - start < 1.0


@pytest.mark.parametrize(
    ("size", "material", "said"),
    [(1.0, "plastic", "lower E/density"), (1.5, "steel", "size"), (1.0, "spruce", "not isotropic")],
)
def test_what_is_not_known_is_said(size: float, material: str, said: str) -> None:
    known = known_shape(OBJECTS["bar"], ["steel", "wood"], largest=1.2)
    with pytest.raises(ModalError, match=said):
        known.model(size, material)
