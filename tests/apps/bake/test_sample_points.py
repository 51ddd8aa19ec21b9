"""Fewer points of a surface, and more: its own ones, sides apart, no hole."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet.apps.bake.sample_points import sample_points
from sonic_bullet.geometry import face_areas_m2, is_closed, outward_normals, volume_m3
from tests.made.models import box_surface


def test_its_own_vertices_are_kept_as_they_are() -> None:
    vertex, face = box_surface([0.1, 0.2, 0.3])
    point, triangle = sample_points(vertex, face, None)
    assert point is vertex
    assert triangle is face


@pytest.mark.parametrize("count", [40, 150])
def test_fewer_points_of_a_sphere_keep_it_closed(count: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    vertex, face = np.asarray(ball.vertices), np.asarray(ball.faces)
    point, triangle = sample_points(vertex, face, count)
    assert len(point) == count
    assert {tuple(row) for row in point} <= {tuple(row) for row in vertex}
    assert is_closed(triangle)
    assert volume_m3(point, triangle) > 0.75 * volume_m3(vertex, face)
    spacing = min(np.linalg.norm(np.delete(point, i, axis=0) - p, axis=1).min() for i, p in enumerate(point))
    assert spacing > 0.6 * np.sqrt(4 * np.pi / count)


def test_the_sides_of_a_thin_plate_stay_apart() -> None:
    """Along the surface they are far from each other, through the plate 1 mm."""
    plate = trimesh.creation.box((0.2, 0.2, 0.001)).subdivide_to_size(0.02)
    vertex, face = np.asarray(plate.vertices), np.asarray(plate.faces)
    point, triangle = sample_points(vertex, face, 80)
    inside = (np.abs(point[triangle][:, :, :2]) < 0.07).all(axis=(1, 2))  # of the rim, round which some go
    height = point[triangle][inside][:, :, 2]
    assert inside.sum() > 8
    np.testing.assert_array_equal(np.ptp(height, axis=1), 0)
    side = outward_normals(point, triangle)[inside][:, 2] * np.sign(height[:, 0])
    assert (side > 0.99).all()


def test_vertices_on_one_place_are_one() -> None:
    """STL holds a vertex as often as it has triangles."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    corner = np.asarray(ball.vertices)[np.asarray(ball.faces)].reshape(-1, 3)
    point, triangle = sample_points(corner, np.arange(len(corner)).reshape(-1, 3), 60)
    assert len({tuple(row) for row in point}) == 60
    assert is_closed(triangle)


@pytest.mark.parametrize("count", [9, 50, 333])
def test_more_points_leave_the_surface_what_it_is(count: int) -> None:
    vertex, face = box_surface([0.3, 0.02, 0.01])
    point, triangle = sample_points(vertex, face, count)
    np.testing.assert_array_equal(point[:8], vertex)
    assert len(point) == count
    assert is_closed(triangle)
    assert volume_m3(point, triangle) == pytest.approx(volume_m3(vertex, face))
    assert face_areas_m2(point, triangle).sum() == pytest.approx(face_areas_m2(vertex, face).sum())
    edge = np.linalg.norm(point[triangle] - point[np.roll(triangle, -1, axis=1)], axis=2).max()
    assert edge <= (0.31 if count == 9 else 0.1 if count == 50 else 0.03)
