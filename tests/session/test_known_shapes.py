"""A shape solved once gives every size and isotropic material as a fresh solution does, and soon."""

from __future__ import annotations

import os
import time
from dataclasses import replace

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.apps.dataset.impacts import OBJECTS
from sonic_bullet.files.presets import load_material
from sonic_bullet.geometry.triangles import face_areas_m2
from sonic_bullet.radiation import far_field
from sonic_bullet.radiation.radiated import radiation_of
from sonic_bullet.records import ModalModel, Shape
from sonic_bullet.records.errors import ModalError
from sonic_bullet.session.body_models import analyse_body
from sonic_bullet.session.known_shapes import known_shape
from tests.contracts.test_architecture import slack
from tests.few_cases import parametrize_few

FREQUENCY_MARGIN = 1.02

AIR = sb.Air()
MATERIALS = ("steel", "glass", "wood", "aluminium")


def resized(shape: Shape, size: float) -> Shape:
    return replace(shape, size_m=shape.size_m * size, vertex_m=shape.vertex_m * size)


def third_octaves_apart_db(model: ModalModel, fresh: ModalModel) -> np.ndarray:
    """Differences of third octaves of radiated power per squared modal velocity: pairs turn as they like."""
    levels = []
    for one, weight in ((model, radiation_of(model, AIR)[0]), (fresh, far_field.radiation(fresh, AIR)[0])):
        third = np.round(3 * np.log2(one.freq_hz / 1000)).astype(int)[: model.mode_count]
        levels.append(np.bincount(third + 30, np.abs(weight[: len(third)]) ** 2, 50))
    both = (levels[0] > 0) & (levels[1] > 0)
    return np.asarray(10 * np.log10(levels[0][both] / levels[1][both]))


def mean_square(model: ModalModel, count: int) -> np.ndarray:
    """Mean over the surface (m,) of squared motion times mass, which no mesh has a part in."""
    area = face_areas_m2(model.vertex_m, model.face)
    square = (model.shape[:, :, :count].astype(float) ** 2).sum(axis=1)[model.face].mean(axis=1)
    return np.asarray(area @ square / area.sum() * model.mass_kg)


CASES = [
    (name, *made)
    for made in ((0.6, "glass"), (1.3, "wood"), (1.0, "steel"))
    for name in ("square-plate", "bowl", "bar", "ring")
]


@parametrize_few(("name", "size", "material"), CASES, (0, 5))
def test_a_size_and_a_material_are_those_of_a_fresh_solution(name: str, size: float, material: str) -> None:
    shape = OBJECTS[name]
    model = known_shape(shape, MATERIALS, largest=1.3).model(size, material)
    made, slow = load_material(material), load_material("wood")
    # as many modes as the shape is known for, so that its surface has as many triangles: the near field on 700 of a
    # thin plate depends on them by 1 dB
    stiffer = np.sqrt(made.youngs_pa / made.density_kg_m3 / (slow.youngs_pa / slow.density_kg_m3))
    fresh = analyse_body(
        (resized(shape, size),), made, accuracy=0.001, to_hz=20_000 * FREQUENCY_MARGIN * 1.3 / size * stiffer
    )
    count = model.mode_count
    assert 5 < count == (fresh.omega0_squared_per_s2 <= (2 * np.pi * 20_000) ** 2).sum()
    np.testing.assert_allclose(model.freq_hz[:count], fresh.freq_hz[:count], rtol=1e-3)
    np.testing.assert_allclose(model.decay_per_s[:count], fresh.decay_per_s[:count], rtol=3e-3)
    assert model.mass_kg == pytest.approx(fresh.mass_kg, rel=1e-3)
    apart_db = third_octaves_apart_db(model, fresh)
    assert len(apart_db) > 3 and np.abs(apart_db).max() < 0.5
    assert mean_square(model, count).mean() == pytest.approx(mean_square(fresh, count).mean(), rel=0.02)


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


@pytest.mark.slow  # of an idle machine: beside other work it takes twice as long
def test_a_size_costs_little() -> None:
    known = known_shape(OBJECTS["bowl"], MATERIALS, largest=1.3)
    known.model(1.0, "steel")
    start = time.process_time()
    for size in (0.6, 0.7, 0.8, 0.9, 1.1):
        known.model(size, "steel")
    assert (time.process_time() - start) / 5 < 0.05 * slack()


def test_known_shapes_cost_what_was_asked() -> None:
    known = known_shape(OBJECTS["bowl"], MATERIALS, largest=1.3)
    first, other = (
        sb.Material.isotropic("made", youngs_pa=e, poisson=0.31, density_kg_m3=density, alpha_per_s=1, beta_s=1e-8)
        for e, density in ((9e10, 4000 + os.getpid() % 997), (8e10, 5000 + os.getpid() % 997))
    )  # of no earlier run

    known.model(1.0, first)  # kernels are compiled
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
