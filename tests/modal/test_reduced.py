"""Families: boxes by polynomials against closed forms and against elements, turned and scaled; slopes against differences."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import closed_forms as exact
from sonic_bullet.modal import polynomials
from sonic_bullet.modal.reduced import family
from sonic_bullet.records import Array, Shape

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
    found = family(Shape("box", np.array([side, side, thick])), gamma_m2_s2=GAMMA, poisson=NU, to_hz=1.02 * wanted[-1], cache=None)
    assert not found.meshed
    assert hz(found.modes(GAMMA, NU)[0][: len(wanted)]) == pytest.approx(wanted, rel=1e-3)


def test_a_slender_bar_by_polynomials_bends_as_timoshenko_says() -> None:
    length, side = 0.4, 0.004
    wanted = exact.bar_bending_hz(length, side, side, GAMMA, NU, 1.0, 6)
    found = family(box_mesh((length, side, side)), gamma_m2_s2=GAMMA, poisson=NU, to_hz=1.05 * wanted[-1], cache=None)
    near = hz(found.modes(GAMMA, NU)[0])
    assert np.array([near[np.argsort(np.abs(near / f - 1))[:2]] for f in wanted]) == pytest.approx(np.stack([wanted, wanted], axis=1), rel=3e-4)


@pytest.mark.parametrize("size", [(0.2, 0.13, 0.01), (0.1, 0.02, 0.006), (0.05, 0.05, 0.05), (0.08, 0.06, 0.025)])
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
