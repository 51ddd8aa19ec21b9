"""Fields of degree 2 and 3: partition of one, exact derivatives, conforming elements, and the rate of thin plates."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.modal import fem, lagrange, lanczos
from sonic_bullet.modal.meshing import structured
from sonic_bullet.modal.meshing.solid import Solid, surface
from sonic_bullet.records import Material, Shape

BALL, SLAB = structured.sphere(1.0, 2), structured.box(np.array([1.0, 0.8, 0.1]), (3, 2, 1))
STIFF = Material.isotropic("m", youngs_pa=1.0, poisson=0.3, density_kg_m3=1.0).stiffness_pa


@pytest.mark.parametrize("degree", [2, 3])
def test_shape_functions_are_one_at_their_node_and_their_slopes_are_theirs(degree: int) -> None:
    node = lagrange.local_nodes(degree)
    np.testing.assert_allclose(lagrange.values(degree, node), np.eye(len(node)), atol=1e-12)
    point, step = np.array([[0.2, 0.3, 0.1]]), 1e-6
    slope = lagrange.gradients(degree, point)[:, :, 0]
    for axis, move in enumerate(step * np.eye(3)):
        ahead, behind = lagrange.values(degree, point + move), lagrange.values(degree, point - move)
        np.testing.assert_allclose(slope[:, axis], (ahead - behind)[:, 0] / (2 * step), atol=1e-8)
    np.testing.assert_allclose(slope.sum(axis=0), 0, atol=1e-12)


@pytest.mark.parametrize("solid", [BALL, SLAB], ids=["curved", "straight"])
@pytest.mark.parametrize("degree", [2, 3])
def test_what_is_rigid_costs_nothing_and_what_is_stretched_its_work(solid: Solid, degree: int) -> None:
    """uᵀKu of a uniform strain is ε:C:ε V and the mass is the volume: elements fit together, curved ones too."""
    nodes = lagrange.field(solid, degree)
    stiff, mass = fem.assemble(solid, STIFF, 1.0, nodes)
    rigid = fem.rigid_modes(nodes.node_m)
    assert np.abs(stiff @ rigid).max() < 1e-9 * np.abs(stiff).max()
    strain = np.array([[0.3, 0.1, 0.2], [0.1, -0.2, 0.4], [0.2, 0.4, 0.5]])
    moved = (nodes.node_m @ strain).ravel()
    voigt = np.array([0.3, -0.2, 0.5, 0.8, 0.4, 0.2])
    volume = fem.volume_m3(solid)
    assert moved @ stiff @ moved == pytest.approx(voigt @ STIFF @ voigt * volume, rel=1e-9)
    assert rigid[:, 0] @ mass @ rigid[:, 0] == pytest.approx(volume, rel=1e-9)


def test_a_cubic_field_is_seen_on_the_solids_own_nodes() -> None:
    nodes = lagrange.field(SLAB, 3)
    skin = surface(SLAB)

    def cubic(x: np.ndarray) -> np.ndarray:
        return np.asarray(x[:, 0] ** 3 - 2 * x[:, 0] * x[:, 1] * x[:, 2] + x[:, 1] ** 2)

    seen = lagrange.at_nodes(nodes, SLAB, skin.node) @ cubic(nodes.node_m)
    np.testing.assert_allclose(seen, cubic(SLAB.node_m[skin.node]), atol=1e-12)


def test_a_thin_plate_takes_degree_three() -> None:
    """With a third more unknowns its λ, averaged over six modes, is off by less than a fifth of what degree 2 is."""
    from sonic_bullet.modal import analyse

    plate = Material.isotropic("m", youngs_pa=2e11, poisson=0.3, density_kg_m3=7850.0)
    size = np.array([1.0, 0.8, 0.02])
    exact = (2 * np.pi * analyse((Shape("box", size),), plate, count=6, cache=None).freq_hz) ** 2 * 7850 / 2e11
    lost = {}
    for degree, cells in ((2, 6), (3, 4)):
        solid = structured.box(size, (cells, cells, 1))
        stiff, mass = fem.assemble(solid, STIFF, 1.0, lagrange.field(solid, degree))
        found = lanczos.solve(stiff, mass, -1e-4, rigid=6, enough=lambda value: len(value) >= 6, most=6)
        lost[degree] = float((found.lambda_per_s2[:6] / exact - 1).mean())
    assert 0 < lost[3] < 0.2 * lost[2]
