"""Named shapes and the same shapes as meshes against pencil and paper; the order of convergence; the yardsticks
themselves.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import analyse
from sonic_bullet.records import Material, Shape
from tests.few_cases import parametrize_few
from tests.made import closed_forms as exact

E, NU, RHO = 200e9, 0.3, 7850.0
LENGTH, SIDE = 0.4, 0.02


def as_mesh(mesh: trimesh.Trimesh) -> Shape:
    return Shape("mesh", vertex_m=mesh.vertices, face=mesh.faces)


def bar_hz() -> np.ndarray:
    bending = exact.bar_bending_hz(LENGTH, SIDE, SIDE, E, NU, RHO, 6)
    rest = (
        exact.bar_longitudinal_hz(LENGTH, SIDE, SIDE, E, NU, RHO, 3),
        exact.square_bar_torsion_hz(LENGTH, SIDE, E, NU, RHO, 4),
    )
    return np.sort(np.concatenate([bending, bending, *rest]))[:10]


def test_timoshenko_tends_to_euler_for_thin_bars() -> None:
    thin = exact.bar_bending_hz(1.0, 1e-3, 1e-3, E, NU, RHO, 3)
    euler = np.array([22.373, 61.673, 120.90]) / (2 * np.pi) * np.sqrt(E * 1e-6 / 12 / RHO)
    assert np.allclose(thin, euler, rtol=3e-5)


def test_ball_multiplets_are_lambs() -> None:
    """Published: lowest torsional ωa/c_s = 2.501; lowest spheroidal 2.640 at ν = 1/4 [Lamb 1882]."""
    shear = np.sqrt(E / 2.5 / RHO)
    found = exact.sphere_multiplets_hz(1.0, E, 0.25, RHO, 6)
    eta = {name: f * 2 * np.pi / shear for f, _, name in reversed(found)}
    assert eta["T2"] == pytest.approx(2.501, abs=1e-3)
    assert eta["S2"] == pytest.approx(2.640, abs=1e-3)


@parametrize_few("made", ["named", "twelve triangles", "turned, fine mesh"], (1, 2))
def test_ten_modes_of_a_slender_bar(steel: Material, made: str) -> None:
    mesh = trimesh.creation.box((LENGTH, SIDE, SIDE))
    if made == "turned, fine mesh":
        mesh = mesh.subdivide().subdivide()
        mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.3, 0.7, 0.1])))
    shape = Shape("box", [LENGTH, SIDE, SIDE]) if made == "named" else as_mesh(mesh)
    found = analyse((shape,), steel, count=10, cache=None).freq_hz
    assert np.abs(found / bar_hz() - 1).max() < 5e-3


@parametrize_few("ratio", [0.01, 0.005], 1)
def test_ten_modes_of_a_thin_plate(steel: Material, ratio: float) -> None:
    shape = (
        as_mesh(trimesh.creation.box((0.2, 0.2, 0.2 * ratio)))
        if ratio == 0.01
        else Shape("box", [0.2, 0.2, 0.2 * ratio])
    )
    found = analyse((shape,), steel, count=10, cache=None).freq_hz
    assert np.abs(found / exact.free_square_plate_hz(0.2, 0.2 * ratio, E, RHO) - 1).max() < 5e-3


def test_six_multiplets_of_a_ball(steel: Material) -> None:
    multiplets = exact.sphere_multiplets_hz(0.05, E, NU, RHO, 6)
    wanted = np.concatenate([[f] * n for f, n, _ in multiplets])
    model = analyse((Shape("sphere", [0.05, 0, 0]),), steel, count=len(wanted), edge_m=0.05 / 4, cache=None)
    assert np.abs(model.freq_hz / wanted - 1).max() < 5e-3
    assert np.allclose(model.curvature_per_m, 20.0, rtol=1e-12)
    assert model.volume_m3 == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=4e-3)


@pytest.mark.slow
def test_first_multiplets_of_a_ball_from_a_mesh(steel: Material) -> None:
    (f, n, _), (g, k, _) = exact.sphere_multiplets_hz(0.05, E, NU, RHO, 2)
    ball = trimesh.creation.icosphere(3, radius=0.05)
    found = analyse((as_mesh(ball),), steel, count=n + k, accuracy=5e-3, cache=None)
    grown = (ball.volume / (4 / 3 * np.pi * 0.05**3)) ** (1 / 3)  # flat facets cut the ball smaller: f ∝ 1/r
    assert np.abs(found.freq_hz * grown / np.concatenate([[f] * n, [g] * k]) - 1).max() < 5e-3


@pytest.mark.slow
def test_eigenvalues_converge_with_the_fourth_power_of_the_element(steel: Material) -> None:
    """λ_h = λ + c h^(2p), p = 2 [Strang & Fix 1973, ch. 6], fitted on the first six modes of the slender bar
    under uniform refinement.
    """
    from scipy.optimize import brentq

    cuts = np.array([2.0, 3.0, 4.0])
    bar = Shape("box", [LENGTH, SIDE, SIDE])
    value = [analyse((bar,), steel, count=6, edge_m=SIDE / n, cache=None).omega0_squared_per_s2 for n in cuts]
    h = 1 / cuts
    for ratio in (value[0] - value[1]) / (value[1] - value[2]):
        order = brentq(lambda p, ratio=ratio: ratio - (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p), 1, 8)
        assert order == pytest.approx(4, abs=0.3)
