"""Families of boxes and of bodies of revolution against closed forms and against elements, turned and shifted; slopes
against differences.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import analyse, polynomials
from sonic_bullet.modal.reduced import family
from sonic_bullet.modal.revolution import rings, section
from sonic_bullet.records import Array, Material, Shape
from tests.few_cases import parametrize_few
from tests.made import closed_forms as exact

GAMMA, NU = 2.5e7, 0.3


def box_mesh(size: tuple[float, float, float], turn: Array | None = None) -> Shape:
    mesh = trimesh.creation.box(size).subdivide()
    if turn is not None:
        mesh.apply_transform(turn)
    return Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)


def hz(value: Array) -> Array:
    return np.asarray(np.sqrt(value) / (2 * np.pi))


def test_a_square_plate_by_polynomials_is_the_published_one() -> None:
    side, thick = 0.2, 0.0005
    wanted = exact.free_square_plate_hz(side, thick, GAMMA, 1.0)
    found = family(
        Shape("box", np.array([side, side, thick])), gamma_m2_s2=GAMMA, poisson=NU, to_hz=1.02 * wanted[-1], cache=None
    )
    assert not found.meshed
    assert hz(found.modes(GAMMA, NU)[0][: len(wanted)]) == pytest.approx(wanted, rel=1e-3)


def test_a_slender_bar_by_polynomials_bends_as_timoshenko_says() -> None:
    length, side = 0.4, 0.004
    wanted = exact.bar_bending_hz(length, side, side, GAMMA, NU, 1.0, 6)
    found = family(box_mesh((length, side, side)), gamma_m2_s2=GAMMA, poisson=NU, to_hz=1.05 * wanted[-1], cache=None)
    near = hz(found.modes(GAMMA, NU)[0])
    assert np.array([near[np.argsort(np.abs(near / f - 1))[:2]] for f in wanted]) == pytest.approx(
        np.stack([wanted, wanted], axis=1), rel=3e-4
    )


@pytest.mark.slow
@parametrize_few("size", [(0.2, 0.13, 0.01), (0.1, 0.02, 0.006), (0.05, 0.05, 0.05), (0.08, 0.06, 0.025)], (0, 2))
def test_more_polynomials_change_nothing(size: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch) -> None:
    shape, top = Shape("box", np.array(size)), 3_000 / max(size)
    usual = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=top, cache=None)
    rule = polynomials.degrees
    monkeypatch.setattr(polynomials, "degrees", lambda size, wave: tuple(n + 2 for n in rule(size, wave)))
    more = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=top, cache=None)
    assert usual.count == more.count > 4
    gain = np.log(usual.modes(GAMMA, NU)[0] / more.modes(GAMMA, NU)[0]) / 2
    assert gain.min() > -1e-9  # Ritz: from above
    assert gain.max() < 2e-4


def test_polynomials_and_elements_move_alike() -> None:
    """Frequencies and shapes at points of a turned, shifted box; its modes scale as they must."""
    size = (0.1, 0.03, 0.01)
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.7, 0.1]))
    turn[:3, 3] = (0.1, 0.2, -0.3)
    shape = box_mesh(size, turn)
    ours = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=25_000, cache=None)
    theirs = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=25_000, edge_m=0.005, cache=None)
    assert theirs.meshed and 5 < ours.count <= theirs.count
    value, vector = ours.modes(GAMMA, 0.27)
    other, turned = (part[..., : ours.count] for part in theirs.modes(GAMMA, 0.27))
    assert hz(other) == pytest.approx(hz(value), rel=5e-3)
    assert (other > value).all()  # elements are too stiff
    mesh = trimesh.Trimesh(shape.vertex_m, shape.face)
    point, where = trimesh.sample.sample_surface(mesh, 30, seed=3)
    a, off = ours.points(point, mesh.face_normals[where])
    b, _ = theirs.points(point, mesh.face_normals[where])
    assert off.max() < 1e-12
    a, b = a @ vector, b @ turned
    sign = np.sign((a * b).sum(axis=0))
    assert np.abs(a * sign - b).max() < 0.02 * np.abs(b).max()
    assert ours.volume_m3 == pytest.approx(np.prod(size), rel=1e-12)
    step = 1e-4
    slope = (np.log(ours.modes(1.0, 0.27 + step)[0]) - np.log(ours.modes(1.0, 0.27 - step)[0])) / (2 * step)
    assert ours.slope(0.27, vector) == pytest.approx(slope, abs=1e-5)


def test_a_cube_has_its_triplets() -> None:
    """Modes of a cube come in ones, twos and threes, spread over the parities; none is lost and none split."""
    found = family(Shape("box", np.full(3, 0.05)), gamma_m2_s2=GAMMA, poisson=0.25, to_hz=60_000, cache=None)
    f = hz(found.modes(GAMMA, 0.25)[0])
    groups = np.split(f, np.flatnonzero(np.diff(f) > 1e-6 * f[1:]) + 1)
    whole = [len(g) for g in groups[:-1]]
    assert set(whole) <= {1, 2, 3} and whole.count(3) >= 3
    assert whole[0] == 2  # twist about an axis has the lowest [Demarest 1971]


def ring_mesh(inner: float, outer: float, height: float, turn: Array | None = None, sections: int = 96) -> Shape:
    mesh = trimesh.creation.annulus(inner, outer, height, sections=sections)
    if turn is not None:
        mesh.apply_transform(turn)
    return Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)


def test_a_thin_ring_bends_in_its_plane_as_love_says() -> None:
    """ω² = E I m²(m²−1)²/(ρ A R⁴ (m²+1)), a twin each [Love 1927, art. 293]."""
    radius, thick, tall = 0.1, 0.001, 0.001
    found = family(
        ring_mesh(radius - thick / 2, radius + thick / 2, tall), gamma_m2_s2=GAMMA, poisson=NU, to_hz=1500, cache=None
    )
    assert not found.meshed
    near = hz(found.modes(GAMMA, NU)[0])
    for m in (2, 3, 4, 5):
        wanted = np.sqrt(GAMMA * thick**2 / 12 / radius**4 * m**2 * (m**2 - 1) ** 2 / (m**2 + 1)) / (2 * np.pi)
        degenerate = near[np.argsort(np.abs(near / wanted - 1))[:2]]
        assert degenerate == pytest.approx([wanted, wanted], rel=2e-3)


def test_a_tube_twists_as_a_string_swings() -> None:
    """Torsion of a tube with free ends: n/2L √(G/ρ), exactly, whatever its wall."""
    length = 0.2
    found = family(ring_mesh(0.01, 0.016, length), gamma_m2_s2=GAMMA, poisson=NU, to_hz=16_000, cache=None)
    near = hz(found.modes(GAMMA, NU)[0])
    for n in (1, 2):
        wanted = n / (2 * length) * np.sqrt(GAMMA / (2 * (1 + NU)))
        assert np.abs(near / wanted - 1).min() < 2e-6


@pytest.mark.slow
def test_a_turned_ring_moves_as_elements_do() -> None:
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.7, 0.1]))
    turn[:3, 3] = (0.1, 0.2, -0.3)
    shape = ring_mesh(0.03, 0.05, 0.02, turn, sections=64)
    ours = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=21_000, cache=None)
    theirs = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=21_000, edge_m=0.008, cache=None)
    assert theirs.meshed and not ours.meshed
    value, vector = ours.modes(GAMMA, NU)
    other, turned = (part[..., : ours.count] for part in theirs.modes(GAMMA, NU))
    assert ours.count > 8 and hz(other) == pytest.approx(hz(value), rel=1.5e-2)
    assert ours.volume_m3 == pytest.approx(theirs.volume_m3, rel=5e-3)
    mesh = trimesh.Trimesh(shape.vertex_m, shape.face)
    point, where = trimesh.sample.sample_surface(mesh, 30, seed=3)
    a, b = (f.points(point, mesh.face_normals[where])[0] for f in (ours, theirs))
    a, b = a @ vector, b @ turned
    ends = [0, *(np.flatnonzero(np.diff(value) > 1e-4 * value[1:]) + 1), len(value)]
    for start, stop in pairwise(ends):  # twins turn freely: what they do together is compared
        one, two = (x[:, start:stop] @ x[:, start:stop].T for x in (a, b))
        assert np.abs(one - two).max() < 0.04 * np.abs(one).max()


def test_finer_triangles_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    shape = ring_mesh(0.03, 0.05, 0.02)
    usual = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=30_000, cache=None)
    monkeypatch.setattr(section, "WALL", 0.5 * section.WALL)
    monkeypatch.setattr(section, "WAVE", 0.5 * section.WAVE)
    finer = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=30_000, cache=None)
    assert usual.count == finer.count > 10
    assert np.abs(np.log(usual.modes(GAMMA, NU)[0] / finer.modes(GAMMA, NU)[0])).max() < 4e-4


def test_what_is_not_round_is_no_body_of_revolution() -> None:
    assert (
        rings.recognise_revolution(*trimesh_parts(trimesh.creation.annulus(0.03, 0.05, 0.02, sections=64))) is not None
    )
    nut = trimesh.creation.annulus(0.03, 0.05, 0.02, sections=6)
    dented = trimesh.creation.annulus(0.03, 0.05, 0.02, sections=64)
    dented.vertices[5] *= 1.01
    for mesh in (nut, dented, trimesh.creation.box((0.1, 0.1, 0.02))):
        assert rings.recognise_revolution(*trimesh_parts(mesh)) is None


def trimesh_parts(mesh: trimesh.Trimesh) -> tuple[Array, Array]:
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


@pytest.mark.parametrize("turned", [False, True])
def test_analyse_and_family_tell_the_same_of_a_box(turned: bool) -> None:
    turn = trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.7, 0.1])) if turned else None
    shape = box_mesh((0.1, 0.04, 0.01), turn)
    steel = Material.isotropic("steel", youngs_pa=GAMMA * 7850, poisson=NU, density_kg_m3=7850.0)
    model = analyse((shape,), steel, to_hz=16_000, cache=None)
    other = family(shape, gamma_m2_s2=GAMMA, poisson=NU, to_hz=18_000, cache=None)
    value, vector = other.modes(GAMMA, NU)
    n = model.mode_count
    assert "polynomials" in model.note and n > 4
    assert model.freq_hz == pytest.approx(hz(value[:n]), rel=1e-4)
    spots = model.vertex_m[::97]
    rows = np.stack([other.points(spots, np.tile(axis, (len(spots), 1)))[0] for axis in np.eye(3)], axis=1)
    theirs = rows @ vector[:, :n] / np.sqrt(7850 * other.length_m**3)
    ours = model.shape[::97]
    sign = np.sign((ours * theirs).sum(axis=(0, 1)))
    assert np.abs(ours * sign - theirs).max() < 0.01 * np.abs(ours).max()
