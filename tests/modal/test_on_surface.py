"""Nodes between corners lie on the surface, and elements stay whole."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.modal import fem
from sonic_bullet.modal.meshing import structured
from sonic_bullet.modal.meshing.on_surface import creases, fitted, nearest_on_lines, unfolded
from sonic_bullet.modal.meshing.solid import Solid, quadratic


def straight(solid: Solid) -> Solid:
    return quadratic(solid.node_m, solid.tet[:, :4])


def test_a_ball_of_few_elements_has_a_balls_volume() -> None:
    ball = trimesh.creation.icosphere(4, 0.05)
    made = fitted(straight(structured.sphere(0.05, 2)), np.array(ball.vertices), np.array(ball.faces))
    assert not made.affine
    assert fem.volume_m3(made) == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.006)
    assert fem.volume_m3(straight(structured.sphere(0.05, 2))) < 0.93 * 4 / 3 * np.pi * 0.05**3


def test_a_rim_is_followed_along_its_crease() -> None:
    """A cylinder of six sides, its surface one of 96: the rim's middles lie on the circle, the end faces stay flat."""
    round_one = trimesh.creation.cylinder(0.02, 0.03, sections=96)
    made = fitted(
        straight(structured.cylinder(0.02, 0.03, 2, 2)), np.array(round_one.vertices), np.array(round_one.faces)
    )
    assert fem.volume_m3(made) == pytest.approx(round_one.volume, rel=0.003)
    assert np.abs(made.node_m[:, 2]).max() == pytest.approx(0.015, abs=1e-12)


def test_a_box_is_left_as_it_is() -> None:
    box = trimesh.creation.box((0.1, 0.05, 0.02))
    solid = structured.box(np.array([0.1, 0.05, 0.02]), (3, 2, 1))
    made = fitted(solid, np.array(box.vertices), np.array(box.faces))
    assert made.affine and np.abs(made.node_m - solid.node_m).max() == 0


def test_an_element_that_folds_is_straight_again() -> None:
    solid = structured.box(np.array([1.0, 1.0, 1.0]), (1, 1, 1))
    node = solid.node_m.copy()
    node[solid.tet[0, 4]] += 0.7 * (node[solid.tet[0, 3]] - node[solid.tet[0, 0]])
    mended = unfolded(Solid(node, solid.tet, False))
    np.testing.assert_allclose(mended.node_m, solid.node_m, atol=1e-12)


def test_creases_of_a_box_are_its_edges_and_points_find_them() -> None:
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    line = creases(np.array(box.vertices), np.array(box.faces))
    assert len(line) == 12
    found = nearest_on_lines(np.array(box.vertices)[line], np.array([[0.9, 0.8, 0.1], [2.0, 2.0, 2.0]]))
    np.testing.assert_allclose(found, [[1, 1, 0.1], [1, 1, 1]])
