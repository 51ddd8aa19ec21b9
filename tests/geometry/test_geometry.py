"""Nearest points against brute force, walls and lids; volume, inertia and curvature against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from sonic_bullet import geometry
from sonic_bullet.records.errors import MeshError


def parts(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return np.array(mesh.vertices), np.array(mesh.faces)


def dense(vertex: np.ndarray, face: np.ndarray, point: np.ndarray) -> float:
    """Distance by sampling every triangle's barycentric grid: an upper bound, tight to the grid."""
    i, j = np.meshgrid(np.arange(41), np.arange(41))
    u, v = (i / 40)[i + j <= 40], (j / 40)[i + j <= 40]
    samples = np.einsum("ks,fsx->fkx", np.stack([u, v, 1 - u - v], axis=1), vertex[face])
    return float(np.linalg.norm(samples - point, axis=2).min())


def test_nearest_point_is_nearest() -> None:
    vertex, face = parts(trimesh.creation.box((1, 2, 3)).subdivide())
    point = np.random.default_rng(1).uniform(-2, 2, (60, 3))
    found, barycentric, distance = geometry.closest_point(vertex, face, point)
    hit = np.einsum("kc,kcx->kx", barycentric, vertex[face[found]])
    assert np.allclose(np.linalg.norm(hit - point, axis=1), distance, atol=1e-12)
    assert (barycentric >= 0).all() and np.allclose(barycentric.sum(axis=1), 1)
    for p, d in zip(point, distance, strict=True):
        assert d <= dense(vertex, face, p) + 1e-12 and d >= dense(vertex, face, p) - 0.02


def test_normal_chooses_the_side_of_a_thin_wall() -> None:
    vertex, face = parts(trimesh.creation.box((1, 1, 0.01)))
    point = np.array([[0.2, 0.1, 0.004], [0.2, 0.1, 0.004]])
    found, _, distance = geometry.closest_point(vertex, face, point, np.array([[0, 0, 1.0], [0, 0, -1.0]]))
    normal = geometry.outward_normals(vertex, face)[found]
    assert normal[:, 2] == pytest.approx([1, -1])
    assert distance == pytest.approx([0.001, 0.009])


def test_point_on_a_bowls_lid_goes_to_the_surface_that_looks_up() -> None:
    bowl = trimesh.creation.icosphere(4, radius=1.0)
    bowl.update_faces(bowl.triangles_center[:, 2] < 0)
    inner = bowl.copy()
    inner.apply_scale(0.95)
    vertex = np.concatenate([bowl.vertices, inner.vertices])
    face = np.concatenate([bowl.faces, inner.faces[:, ::-1] + len(bowl.vertices)])
    found, _, _ = geometry.closest_point(vertex, face, np.array([[0.1, 0, -0.2]]), np.array([[0, 0, 1.0]]))
    assert geometry.outward_normals(vertex, face)[found][0, 2] > 0


def test_index_needs_faces() -> None:
    with pytest.raises(MeshError):
        geometry.surface_index(np.zeros((0, 3)), np.zeros((0, 3), int))


def test_volume_inertia_and_orientation() -> None:
    vertex, face = parts(trimesh.creation.box((1, 2, 3)))
    mass, centre, inertia = geometry.inertia(vertex + np.array([5, 6, 7]), face, 2.0)
    assert mass == pytest.approx(12) and centre == pytest.approx([5, 6, 7])
    assert np.allclose(inertia, np.diag([13, 10, 5]))  # m (b² + c²) / 12
    assert geometry.volume_m3(vertex, face[:, ::-1]) == pytest.approx(-6)
    assert geometry.is_closed(face) and not geometry.is_closed(face[1:])


def test_curvature() -> None:
    ball = trimesh.creation.icosphere(4, radius=0.05)
    vertex, face = parts(ball)
    assert np.allclose(geometry.face_curvature(vertex, face) * 0.05, 1, atol=0.06)
    assert np.allclose(geometry.face_curvature(vertex, face[:, ::-1]) * 0.05, -1, atol=0.06)
    assert not geometry.face_curvature(*parts(trimesh.creation.box((1, 2, 3)))).any()
    tube = geometry.face_curvature(*parts(trimesh.creation.cylinder(0.02, 0.1, sections=64))) * 0.02
    assert set(np.round(tube, 2)) == {0.0, 0.5}
