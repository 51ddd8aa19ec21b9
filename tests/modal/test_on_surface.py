"""Nodes between corners lie on the surface, and elements stay whole."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.apps.dataset.household.objects import shape_of
from sonic_bullet.modal import fem
from sonic_bullet.modal.meshing import structured
from sonic_bullet.modal.meshing.mean_surface import on_the_mean
from sonic_bullet.modal.meshing.on_surface import creases, fit_to_surface, nearest_on_lines, unfold_elements
from sonic_bullet.modal.meshing.shape_meshes import fill
from sonic_bullet.modal.meshing.solid import Solid, corner_volume_m3, quadratic


def straight(solid: Solid) -> Solid:
    return quadratic(solid.node_m, solid.tet[:, :4])


def test_a_ball_of_few_elements_has_a_balls_volume() -> None:
    ball = trimesh.creation.icosphere(4, 0.05)
    made = fit_to_surface(straight(structured.sphere(0.05, 2)), np.array(ball.vertices), np.array(ball.faces))
    assert not made.affine
    assert fem.volume_m3(made) == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.006)
    assert fem.volume_m3(straight(structured.sphere(0.05, 2))) < 0.93 * 4 / 3 * np.pi * 0.05**3


def test_a_rim_is_followed_along_its_crease() -> None:
    """A cylinder of six sides, its surface one of 96: the rim's middles lie on the circle, the end faces stay flat."""
    round_one = trimesh.creation.cylinder(0.02, 0.03, sections=96)
    made = fit_to_surface(
        straight(structured.cylinder(0.02, 0.03, 2, 2)), np.array(round_one.vertices), np.array(round_one.faces)
    )
    assert fem.volume_m3(made) == pytest.approx(round_one.volume, rel=0.003)
    assert np.abs(made.node_m[:, 2]).max() == pytest.approx(0.015, abs=1e-9)


def test_a_box_is_left_as_it_is() -> None:
    box = trimesh.creation.box((0.1, 0.05, 0.02))
    solid = structured.box(np.array([0.1, 0.05, 0.02]), (3, 2, 1))
    made = fit_to_surface(solid, np.array(box.vertices), np.array(box.faces))
    assert made.affine and np.abs(made.node_m - solid.node_m).max() == 0


@pytest.mark.parametrize("rings", [1, 2])
def test_flat_sides_hold_the_area_and_the_moment_of_the_circle_they_stand_for(rings: int) -> None:
    """A polygon in the circle has A = n/2 sin(2π/n) R² and J = A R² (2 + cos(2π/n))/6 [Young & Budynas, table A.1]."""
    radius, length, sides = 0.004, 0.05, 6 * rings
    flat = straight(structured.cylinder(radius, length, rings, 12))
    circle = trimesh.creation.cylinder(radius, length, sections=720)
    area, moment = section(flat, length)
    assert area == pytest.approx(sides / 2 * np.sin(2 * np.pi / sides) * radius**2, rel=1e-9)
    assert moment == pytest.approx(area * radius**2 * (2 + np.cos(2 * np.pi / sides)) / 6, rel=1e-9)
    made = on_the_mean(flat, np.array(circle.vertices), np.array(circle.faces))
    area, moment = section(made, length)
    assert area == pytest.approx(np.pi * radius**2, rel=0.01)
    assert moment == pytest.approx(np.pi / 2 * radius**4, rel=0.02)


def section(solid: Solid, length: float) -> tuple[float, float]:
    """Mean area and polar moment of a straight solid along z."""
    volume = np.abs(corner_volume_m3(solid.node_m, solid.tet))
    corner = solid.node_m[solid.tet[:, :4], :2]
    # ∫ x² over a tetrahedron: V/20 (Σ xᵢ² + (Σ xᵢ)²)
    square = ((corner**2).sum(axis=(1, 2)) + (corner.sum(axis=1) ** 2).sum(axis=1)) / 20
    return float(volume.sum() / length), float((volume * square).sum() / length)


def test_an_element_that_folds_is_straight_again() -> None:
    solid = structured.box(np.array([1.0, 1.0, 1.0]), (1, 1, 1))
    node = solid.node_m.copy()
    node[solid.tet[0, 4]] += 0.7 * (node[solid.tet[0, 3]] - node[solid.tet[0, 0]])
    mended = unfold_elements(Solid(node, solid.tet, False))
    np.testing.assert_allclose(mended.node_m, solid.node_m, atol=1e-12)


def test_the_shift_onto_the_mean_turns_no_element_inside_out() -> None:
    """A mug of coarse elements whose curved sides the shift folded: 6 % of a straight element's volume, and below 0."""
    mug = shape_of("mug", 0.004137481131914725, 4357083911216496097)
    solid = fill((mug,), 0.03, None).solid
    assert not solid.affine
    assert fem.volume_m3(solid) == pytest.approx(trimesh.Trimesh(mug.vertex_m, mug.face).volume, rel=0.02)


def test_creases_of_a_box_are_its_edges_and_points_find_them() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    line = creases(np.array(box.vertices), np.array(box.faces))
    assert len(line) == 12
    found = nearest_on_lines(np.array(box.vertices)[line], np.array([[0.9, 0.8, 0.1], [2.0, 2.0, 2.0]]))
    np.testing.assert_allclose(found, [[1, 1, 0.1], [1, 1, 1]])
