"""Shapes come back in the body frame: their extents by the body's pose are those Bullet collides with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from sonic_bullet.geometry import is_closed, volume_m3
from sonic_bullet.records import Shape
from sonic_bullet.records.errors import MeshError
from sonic_bullet.simulators import links_with_shapes, open_world
from sonic_bullet.simulators.pybullet.urdf_meshes import hull, lid_height_m, read_surfaces
from tests.made.scenes import DUCK, collision, floor, thing, turned

DATA = Path(pybullet_data.getDataPath())
MARGIN_M = 0.0045
URDFS = (
    "random_urdfs/000/000.urdf",
    "random_urdfs/123/123.urdf",
    "random_urdfs/999/999.urdf",
    "objects/mug.urdf",
    "duck_vhacd.urdf",
    "domino/domino.urdf",
    "kuka_iiwa/model.urdf",
    "r2d2.urdf",
    "teddy_vhacd.urdf",
    "soccerball.urdf",
    "cube_small.urdf",
    "jenga/jenga.urdf",
    "tray/traybox.urdf",
    "lego/lego.urdf",
    "table/table.urdf",
    "plane.urdf",
)


def matrix(quaternion: Any) -> np.ndarray:
    return np.array(p.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


def hull_points(shape: Shape) -> np.ndarray:
    """Points (k, 3) in the body frame whose bounding box is the shape's."""
    if shape.kind == "mesh":
        local = shape.vertex_m
    elif shape.kind == "box":
        local = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T * shape.size_m
    else:
        radius, length = shape.size_m[:2]
        if shape.kind == "sphere":
            length = 0.0
        around = np.linspace(0, 2 * np.pi, 129)
        rim = radius * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
        local = np.concatenate([rim + np.array([0, 0, length / 2]), rim - np.array([0, 0, length / 2])])
        if shape.kind != "cylinder":
            tilts = np.linspace(0, np.pi / 2, 65)
            dome = np.concatenate([rim * np.cos(t) + np.array([0, 0, radius * np.sin(t) + length / 2]) for t in tilts])
            local = np.concatenate([dome, -dome])
    return local @ matrix(shape.quaternion_xyzw).T + shape.position_m


@pytest.mark.parametrize("urdf", URDFS)
def test_extents_by_the_body_pose_are_those_of_the_collision(client: Any, urdf: str) -> None:
    """Links stand at right angles here, so Bullet's boxes round its hulls are tight but for its margins."""
    body = client.loadURDF(str(DATA / urdf), [1, 2, 3], useFixedBase=True)
    world = open_world(client)
    links = links_with_shapes(world.client_id, body)
    assert links
    for _, link in links:
        position, quaternion = (
            client.getBasePositionAndOrientation(body)
            if link < 0
            else client.getLinkState(body, link, computeForwardKinematics=1)[:2]
        )
        if np.abs(matrix(quaternion)).max(axis=1).min() < 0.999:
            continue
        shapes = world.shapes_of(body, link)
        points = np.concatenate([hull_points(shape) for shape in shapes]) @ matrix(quaternion).T + position
        low, high = np.array(client.getAABB(body, link))
        spread = (
            0.01 * (high - low).max()
            if any(s.kind == "box" and np.abs(matrix(s.quaternion_xyzw)).max(axis=1).min() < 0.999 for s in shapes)
            else 0.0
        )
        assert np.abs(points.min(axis=0) - low).max() < MARGIN_M + spread, (urdf, link)
        assert np.abs(points.max(axis=0) - high).max() < MARGIN_M + spread, (urdf, link)


@pytest.mark.parametrize("maximal", [False, True])
@pytest.mark.parametrize("shape", ["sphere", "box", "capsule", "cylinder", "mesh"])
def test_every_kind_comes_back_as_itself(client: Any, shape: str, maximal: bool) -> None:
    body = thing(client, shape, [0, 0, 1], useMaximalCoordinates=maximal)
    (piece,) = open_world(client).shapes_of(body)
    assert piece.kind == shape
    sizes = {
        "sphere": (0.05, 0, 0),
        "box": (0.2, 0.1, 0.06),
        "capsule": (0.03, 0.1, 0),
        "cylinder": (0.03, 0.1, 0),
        "mesh": (0, 0, 0),
    }
    np.testing.assert_allclose(piece.size_m, sizes[shape], atol=1e-12)


def test_planes_and_compounds(client: Any) -> None:
    world = open_world(client)
    (plane,) = world.shapes_of(floor(client, "plane"))
    assert plane.kind == "plane"
    tilted = client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE, planeNormal=[0, 0.6, 0.8]))
    (slope,) = world.shapes_of(tilted)
    np.testing.assert_allclose(matrix(slope.quaternion_xyzw) @ [0, 0, 1], [0, 0.6, 0.8], atol=1e-9)
    sphere, box = world.shapes_of(thing(client, "compound", [0, 0, 1]))
    assert (sphere.kind, box.kind) == ("sphere", "box")
    np.testing.assert_allclose(box.position_m, [0.05, 0, 0], atol=1e-12)
    np.testing.assert_allclose(matrix(box.quaternion_xyzw), matrix(turned(0.3, 0, 0)), atol=1e-9)


def test_urdf_cylinders_are_cylinders_again(client: Any) -> None:
    robot = client.loadURDF(str(DATA / "r2d2.urdf"))
    world = open_world(client)
    (trunk,) = world.shapes_of(robot)
    assert trunk.kind == "cylinder"
    np.testing.assert_allclose(trunk.size_m[:2], [0.2, 0.6], rtol=0.2)
    (wheel,) = world.shapes_of(robot, 2)
    assert wheel.kind == "cylinder"
    np.testing.assert_allclose(wheel.size_m[:2], [0.035, 0.1], rtol=0.01)


def test_the_file_is_preferred_to_its_hull(client: Any) -> None:
    """A duck collides as its hull; what sounds is the duck, outward and with its own volume."""
    (duck,) = open_world(client).shapes_of(thing(client, "mesh", [0, 0, 1]))
    own, hulled = volume_m3(duck.vertex_m, duck.face), volume_m3(*hull(duck.vertex_m))
    assert 0 < own < 0.9 * hulled


def test_concave_statics_and_bare_vertices(client: Any) -> None:
    world = open_world(client)
    concave = client.createMultiBody(
        0,
        client.createCollisionShape(
            p.GEOM_MESH, fileName=DUCK, meshScale=[0.1] * 3, flags=p.GEOM_FORCE_CONCAVE_TRIMESH
        ),
    )
    (duck,) = world.shapes_of(concave)
    assert len(duck.face) > 4000
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    hulled = client.createMultiBody(1, client.createCollisionShape(p.GEOM_MESH, vertices=corners, meshScale=[0.5] * 3))
    (tetrahedron,) = world.shapes_of(hulled)
    assert is_closed(tetrahedron.face)
    assert volume_m3(tetrahedron.vertex_m, tetrahedron.face) == pytest.approx(0.5**3 / 6, rel=1e-3)
    indexed = client.createMultiBody(
        1, client.createCollisionShape(p.GEOM_MESH, vertices=corners, indices=[0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    )
    with pytest.raises(MeshError, match="pass mesh="):
        world.shapes_of(indexed)
    empty = client.createMultiBody(1)
    with pytest.raises(MeshError, match="no collision shape"):
        world.shapes_of(empty)


def test_obj_objects_are_kept_apart_and_bad_files_named(tmp_path: Path) -> None:
    cube = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    faces = "f 4 3 2 1\nf 5/1 6/2 7/3 8/4\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf -8 -4 -1 -5\n"
    (tmp_path / "two.obj").write_text(f"o one\n{cube}{faces}o two\nf 1 2 3\n")
    one, two = read_surfaces(tmp_path / "two.obj")
    assert len(one[1]) == 12 and len(two[1]) == 1
    assert volume_m3(*one) == pytest.approx(1)
    (tmp_path / "bad.obj").write_text("v 0 0\nf 1 2 3\n")
    for name in ("bad.obj", "none.stl"):
        (tmp_path / "none.stl").write_bytes(b"solid lies")
        with pytest.raises(MeshError, match=name):
            read_surfaces(tmp_path / name)


@pytest.mark.parametrize("wall", [0.3, 0.02])
def test_the_lid_over_a_bowl_stands_as_high_as_the_bowl_is_deep(wall: float) -> None:
    """Whatever its wall is; a ball has no lid, and no more has a brick."""
    import trimesh

    turned = np.concatenate(
        [
            r * np.stack([np.cos(t), np.sin(t)], axis=1)
            for r, t in ((1, np.linspace(-np.pi / 2, 0, 9)), (1 - wall, np.linspace(0, -np.pi / 2, 9)))
        ]
    )
    bowl = trimesh.creation.revolve(turned, sections=48)
    assert lid_height_m(np.array(bowl.vertices), np.array(bowl.faces)) == pytest.approx(1 - wall, rel=0.03)
    for convex in (trimesh.creation.icosphere(2), trimesh.creation.box((1, 2, 3))):
        assert lid_height_m(np.array(convex.vertices), np.array(convex.faces)) < 1e-9


def test_collision_shapes_are_small_enough_to_share(client: Any) -> None:
    """One collision shape, two bodies: each has its pieces."""
    shape = collision(client, "box")
    one, two = (client.createMultiBody(1, shape, basePosition=[k, 0, 0]) for k in range(2))
    world = open_world(client)
    assert world.shapes_of(one)[0].kind == world.shapes_of(two)[0].kind == "box"
