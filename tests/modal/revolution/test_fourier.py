"""Bodies with a solid axis against closed forms: balls, cylinders, discs; their surface; their estimated error."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from sonic_bullet import geometry
from sonic_bullet.modal import analyse, read_mesh
from sonic_bullet.modal.reduced import family
from sonic_bullet.modal.revolution import fourier, section
from sonic_bullet.records import Material, ModalModel, Shape
from tests.few_cases import parametrize_few

ASSETS = Path(__file__).resolve().parents[3] / "assets"
RHO, YOUNG = 7850.0, 2e11


def steel(poisson: float) -> Material:
    return Material.isotropic("steel", youngs_pa=YOUNG, poisson=poisson, density_kg_m3=RHO)


def shear_speed(poisson: float) -> float:
    return float(np.sqrt(YOUNG / (2 * (1 + poisson)) / RHO))


def test_a_ball_rings_as_lamb_says() -> None:
    """ωa/c_s of degree 2: torsional 2.5011, spheroidal 2.6399 at ν = 1/4, five modes each [Lamb 1882; Love 1927, art.
    194]; of degree 1, torsional, 5.7635, three modes.
    """
    radius = 0.05
    model = analyse((Shape("sphere", [radius, 0, 0]),), steel(0.25), count=10, cache=None)
    found = 2 * np.pi * model.freq_hz * radius / shear_speed(0.25)
    assert found == pytest.approx([2.5011] * 5 + [2.6399] * 5, rel=1e-4)
    assert model.curvature_per_m == pytest.approx(1 / radius, rel=1e-3)
    assert "body of revolution" in model.note


def test_a_rod_twists_as_a_string_swings() -> None:
    """n/2L √(G/ρ), exactly: m = 0 with a solid axis."""
    length = 0.1
    model = analyse((Shape("cylinder", [0.02, length, 0]),), steel(0.3), count=6, cache=None)
    assert np.abs(model.freq_hz / (shear_speed(0.3) / (2 * length)) - 1).min() < 1e-6


def test_a_thin_disc_is_kirchhoffs() -> None:
    """λ² = ωa²√(ρh/D) of a free disc at ν = 0.33: 5.253, 9.084, 12.23, 20.52 [Leissa 1969, table 2.5], in pairs but the
    second.
    """
    radius, thick = 0.1, 0.0005
    model = analyse((Shape("cylinder", [radius, thick, 0]),), steel(0.33), count=7, cache=None)
    plate = np.sqrt(YOUNG * thick**2 / (12 * RHO * (1 - 0.33**2))) / radius**2
    assert 2 * np.pi * model.freq_hz / plate == pytest.approx(
        [5.253, 5.253, 9.084, 12.23, 12.23, 20.52, 20.52], rel=2e-3
    )


@pytest.fixture(scope="module")
def bowl() -> ModalModel:
    return analyse((read_mesh(ASSETS / "bowl.obj"),), steel(0.3), to_hz=4_000, cache=None)


def test_pairs_are_degenerate_to_the_bit(bowl: ModalModel) -> None:
    assert bowl.mode_count == 8
    assert (bowl.freq_hz[::2] == bowl.freq_hz[1::2]).all()


def test_the_surface_is_closed_outward_and_has_its_curvature(bowl: ModalModel) -> None:
    assert geometry.is_closed(bowl.face)
    assert geometry.volume_m3(bowl.vertex_m, bowl.face) == pytest.approx(bowl.volume_m3, rel=5e-3)
    flat = np.abs(geometry.outward_normals(bowl.vertex_m, bowl.face)[:, 2]) > 1 - 1e-9
    middle = flat & (np.hypot(*bowl.vertex_m[bowl.face].mean(axis=1)[:, :2].T) < 0.015)
    assert middle.any() and (bowl.curvature_per_m[middle] == 0).all()
    tube = analyse((Shape("cylinder", [0.02, 0.3, 0]),), steel(0.3), count=2, cache=None)
    side = np.abs(geometry.outward_normals(tube.vertex_m, tube.face)[:, 2]) < 1e-6
    assert tube.curvature_per_m[side] == pytest.approx(25, rel=1e-6)
    assert (tube.curvature_per_m[~side] == 0).all()


def test_no_point_is_left_out_and_the_pole_moves_with_its_neighbours(bowl: ModalModel) -> None:
    assert (np.unique(bowl.face) == np.arange(len(bowl.vertex_m))).all()
    radius = np.hypot(bowl.vertex_m[:, 0], bowl.vertex_m[:, 1])
    pole = np.flatnonzero(radius < 1e-9)
    assert len(pole) == 2
    for vertex in pole:
        near = np.setdiff1d(bowl.face[(bowl.face == vertex).any(axis=1)], [vertex])
        apart = np.abs(bowl.shape[near] - bowl.shape[vertex]).max()
        assert apart < 0.1 * np.abs(bowl.shape).max()


def test_shapes_weigh_one(steel_disc: ModalModel) -> None:
    """∫ρ u·u dV of a thin disc from its two faces, each quarter of four triangles one parabola [Zienkiewicz]."""
    gram = np.full((6, 6), 16.0) + 16 * np.eye(6)
    gram[:3, :3] = 7 * np.eye(3) - 1
    gram[:3, 3:] = gram[3:, :3] = 0
    for corner, opposite in ((0, 4), (1, 5), (2, 3)):
        gram[corner, opposite] = gram[opposite, corner] = -4
    quarters = steel_disc.face.reshape(-1, 4, 3)
    six = np.concatenate([np.stack([quarters[:, k, k] for k in range(3)], axis=1), quarters[:, 3]], axis=1)
    area = geometry.face_areas_m2(steel_disc.vertex_m, steel_disc.face).reshape(-1, 4).sum(axis=1)
    flat = np.abs(geometry.outward_normals(steel_disc.vertex_m, steel_disc.face)[::4, 2]) > 0.5
    moved = steel_disc.shape[six[flat]].astype(float)
    weight = RHO * 0.002 / 2 * np.einsum("f,fixm,ij,fjxm->m", area[flat] / 180, moved, gram, moved, optimize=True)
    assert weight == pytest.approx(1, rel=1e-2)  # facets lie within the circle


@pytest.fixture(scope="module")
def steel_disc() -> ModalModel:
    return analyse((Shape("cylinder", [0.1, 0.002, 0]),), steel(0.3), count=5, cache=None)


@parametrize_few("name", ["bowl", "plate", "tumbler"], 1)
def test_scene_and_diagnosis_agree(name: str) -> None:
    """`analyse` and `family` to other limits, with sections of their own."""
    shape = read_mesh(ASSETS / f"{name}.obj")
    model = analyse((shape,), steel(0.3), to_hz=3_000, cache=None)
    value, _ = family(shape, gamma_m2_s2=YOUNG / RHO, poisson=0.28, to_hz=4_000, cache=None).modes(YOUNG / RHO, 0.3)
    assert model.mode_count >= 4
    assert np.sqrt(value[: model.mode_count]) / (2 * np.pi) == pytest.approx(model.freq_hz, rel=5e-4)


def named_error(note: str) -> float:
    return float(re.findall(r"about ([\d.e-]+) %", note)[0]) / 100


@parametrize_few("name", ["bowl", "tumbler"], 1)
def test_the_estimate_is_the_error_within_a_factor_of_two(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a section coarse enough for its error to be seen, against one four times finer."""
    shape = read_mesh(ASSETS / f"{name}.obj")
    with monkeypatch.context() as coarse:
        coarse.setattr(section, "WALL", 3.0)
        coarse.setattr(section, "WAVE", 1.0)
        coarse.setattr(fourier.Fourier, "surface_error", lambda *_: 0.0)  # of facets, which both sections share
        model = analyse((shape,), steel(0.3), count=8, accuracy=0.5, cache=None)
    monkeypatch.setattr(section, "WALL", 0.5)
    true = analyse((shape,), steel(0.3), count=8, cache=None)
    error = float(np.abs(model.freq_hz / true.freq_hz - 1).max())
    assert 0.5 < named_error(model.note) / error < 2


def test_none_asks_for_no_error_and_moves_no_mode() -> None:
    shape = read_mesh(ASSETS / "tumbler.obj")
    told, untold = (analyse((shape,), steel(0.3), count=4, accuracy=a, cache=None) for a in (0.5, None))
    assert np.array_equal(told.freq_hz, untold.freq_hz) and np.array_equal(told.shape, untold.shape)
    assert "error" in told.note and "error" not in untold.note


def test_accuracy_asked_for_is_kept_by_a_finer_section(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(section, "WALL", 3.0)
    monkeypatch.setattr(section, "WAVE", 1.0)
    shape = read_mesh(ASSETS / "tumbler.obj")
    notes = [analyse((shape,), steel(0.3), count=8, accuracy=a, cache=None).note for a in (0.5, 0.002)]
    few, many = (int(re.findall(r"section of (\d+)", note)[0]) for note in notes)
    assert many > few
    assert "under" in notes[1] or named_error(notes[1]) <= 0.002
