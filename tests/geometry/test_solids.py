"""Volume, centre and inertia of shapes, held against trimesh's, and against a cut of the same solid."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from sonic_bullet.geometry import solid_of
from sonic_bullet.records import Shape

PLACE = {"position_m": (0.3, -0.1, 0.2), "quaternion_xyzw": Rotation.from_rotvec([0.4, -0.7, 0.2]).as_quat()}
SHAPES = {
    "sphere": (Shape("sphere", (0.1, 0, 0), **PLACE), trimesh.creation.icosphere(5, 0.1)),
    "box": (Shape("box", (0.1, 0.2, 0.05), **PLACE), trimesh.creation.box((0.1, 0.2, 0.05))),
    "cylinder": (Shape("cylinder", (0.05, 0.3, 0), **PLACE), trimesh.creation.cylinder(0.05, 0.3, 256)),
    "capsule": (Shape("capsule", (0.05, 0.3, 0), **PLACE), trimesh.creation.capsule(0.3, 0.05, count=(64, 256))),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_solids_are_those_of_another_program(kind: str) -> None:
    shape, mesh = SHAPES[kind]
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = Rotation.from_quat(shape.quaternion_xyzw).as_matrix(), shape.position_m
    mesh.apply_translation(-mesh.center_mass)
    mesh.apply_transform(turn)
    volume, centre, moment = solid_of([shape])
    assert volume == pytest.approx(mesh.volume, rel=2e-3)
    assert centre == pytest.approx(mesh.center_mass, abs=1e-6)
    assert np.abs(moment - mesh.moment_inertia).max() < 5e-3 * np.abs(moment).max()


@pytest.mark.parametrize("inward", [False, True])
def test_parts_make_the_whole(inward: bool) -> None:
    """Two halves of a box, one of them a mesh, are that box."""
    mesh = trimesh.creation.box((0.1, 0.2, 0.3))
    face = mesh.faces[:, ::-1] if inward else mesh.faces
    half = Shape("mesh", vertex_m=mesh.vertices + np.array([0.05, 0, 0]), face=face)
    other = Shape("box", (0.1, 0.2, 0.3), position_m=(-0.05, 0, 0))
    whole = solid_of([Shape("box", (0.2, 0.2, 0.3))])
    for one, two in zip(solid_of([half, other, Shape("plane")]), whole, strict=True):
        assert np.allclose(one, two, rtol=1e-12, atol=1e-15)


def test_a_plane_is_no_solid() -> None:
    assert solid_of([Shape("plane")])[0] == 0.0
