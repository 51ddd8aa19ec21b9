"""What sounds is what collides: capsules by their ends, bodies in maximal coordinates, triangles by their vertices."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet import attach
from sonic_bullet.geometry import volume_m3
from sonic_bullet.records.errors import MeshError
from sonic_bullet.session.links_of_script import is_ground
from sonic_bullet.simulators.quiet import quiet_stdout

REPO = Path(__file__).parents[2]
CAPSULE = '<geom type="capsule" fromto="{}" size="{}" density="1000"/>'
BODY = '<mujoco><worldbody><body name="leg" pos="0 0 1">{}<joint type="free"/></body></worldbody></mujoco>'


@pytest.fixture
def client() -> Any:
    with quiet_stdout():
        client = BulletClient(p.DIRECT)
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    return client


@pytest.mark.shared
def test_the_worlds_that_died(shared_path: Path) -> None:
    script = str(shared_path / "faults/05-mjcf-capsule-segfault/attach.py")
    done = subprocess.run([sys.executable, script], cwd=REPO, check=False)
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("ends", "more"),
    [
        ("0 0 0 0 0 0.4", ""),
        ("-0.1 0.05 0.2 0.3 -0.2 -0.1", ""),
        ("0 -.07 0 0 .07 0", '<geom type="sphere" pos="0 0 .19" size=".09"/>'),
        ("0.2 0 0 -0.1 0 0", CAPSULE.format("0 0 0 0.1 0.2 0.3", 0.03)),
    ],
)
def test_a_capsule_by_its_ends_lies_where_it_collides(client: Any, tmp_path: Path, ends: str, more: str) -> None:
    place = tmp_path / "leg.xml"
    place.write_text(BODY.format(CAPSULE.format(ends, 0.05) + more))
    listener = attach(client, microphone=())
    with quiet_stdout():
        (body,) = client.loadMJCF(str(place))
    capsule = listener.world.shapes_of(body)[0]
    want = np.array([float(x) for x in ends.split()]).reshape(2, 3)
    inertial = client.getDynamicsInfo(body, -1)[3]
    axis = np.array(p.getMatrixFromQuaternion(capsule.quaternion_xyzw)).reshape(3, 3)[:, 2]
    reach = capsule.size_m[1] / 2 * axis
    found = np.array([capsule.position_m - reach, capsule.position_m + reach]) + inertial
    assert capsule.kind == "capsule"
    assert capsule.size_m[0] == pytest.approx(0.05)
    assert min(np.abs(found - want).max(), np.abs(found[::-1] - want).max()) < 1e-6


def test_a_capsule_whose_file_is_gone_is_refused_not_asked(client: Any, tmp_path: Path) -> None:
    place = tmp_path / "leg.xml"
    place.write_text(BODY.format(CAPSULE.format("-0.1 0.05 0.2 0.3 -0.2 -0.1", 0.05)))
    listener = attach(client, microphone=())
    with quiet_stdout():
        (body,) = client.loadMJCF(str(place))
    place.unlink()
    with pytest.raises(MeshError, match="cannot be asked"):
        listener.world.shapes_of(body)


@pytest.mark.parametrize(
    ("shape", "volume_m3_"),
    [
        ({"shapeType": p.GEOM_BOX, "halfExtents": [0.05, 0.02, 0.01]}, 8e-5),
        ({"shapeType": p.GEOM_SPHERE, "radius": 0.03}, 4 / 3 * np.pi * 0.03**3),
        ({"shapeType": p.GEOM_CYLINDER, "radius": 0.02, "height": 0.3}, np.pi * 0.02**2 * 0.3),
        ({"shapeType": p.GEOM_MESH, "fileName": "cube.obj", "meshScale": [0.1, 0.2, 0.05]}, 1e-3),
    ],
)
@pytest.mark.parametrize("drawn", ["box", "mesh", "none"])
def test_maximal_coordinates_sound_as_what_collides(client: Any, shape: Any, volume_m3_: float, drawn: str) -> None:
    listener = attach(client, microphone=())
    picture = {"box": {"shapeType": p.GEOM_BOX, "halfExtents": [0.5] * 3}, "mesh": {"shapeType": p.GEOM_MESH}}
    picture["mesh"] |= {"fileName": "duck.obj"}
    visual = client.createVisualShape(**picture[drawn]) if drawn in picture else -1
    body = client.createMultiBody(
        0.6, client.createCollisionShape(**shape), visual, [0, 0, 1], [0.1, 0.2, 0.3, 0.9], useMaximalCoordinates=1
    )
    assert client.getDynamicsInfo(body, -1)[10] == 1
    assert sum(_volume(one) for one in listener.world.shapes_of(body)) == pytest.approx(volume_m3_, rel=0.02)


@pytest.mark.parametrize("seen", [True, False])
def test_what_was_not_seen_is_what_is_drawn_only_where_both_fill_one_space(client: Any, seen: bool) -> None:
    half = [0.05, 0.02, 0.01]
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=half)
    drawn = client.createVisualShape(p.GEOM_BOX, halfExtents=half if seen else [0.06, 0.02, 0.01])
    body = client.createMultiBody(0.6, shape, drawn, [0, 0, 1], [0.1, 0.2, 0.3, 0.9], useMaximalCoordinates=1)
    with pytest.warns(UserWarning) if seen else pytest.raises(MeshError):
        listener = attach(client, microphone=())
        (box,) = listener.world.shapes_of(body)
        assert np.allclose(box.size_m, np.array(half) * 2)
        assert "what is drawn" in listener.notes[0]


@pytest.mark.parametrize("name", ["plane.urdf", "plane100.urdf", "plane_transparent.urdf", "plane_implicit.urdf"])
@pytest.mark.parametrize("maximal", [False, True])
def test_planes_are_ground(client: Any, name: str, maximal: bool) -> None:
    listener = attach(client, microphone=())
    body = client.loadURDF(name, useMaximalCoordinates=maximal)
    assert is_ground(listener.world.shapes_of(body))


@pytest.mark.parametrize("half", [(0.5, 0.5, 0.02), (2.4, 1, 0.05), (1.5, 1.5, 1.5)])
def test_boards_and_blocks_are_no_ground(client: Any, half: tuple[float, ...]) -> None:
    listener = attach(client, microphone=())
    body = client.createMultiBody(0, client.createCollisionShape(p.GEOM_BOX, halfExtents=half))
    assert not is_ground(listener.world.shapes_of(body))


def test_triangles_by_their_vertices_are_known(client: Any) -> None:
    listener = attach(client, microphone=())
    vertex = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    index = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
    shape = client.createCollisionShape(
        p.GEOM_MESH, vertices=vertex, indices=index, meshScale=[0.1, 0.2, 0.3], collisionFramePosition=[0, 0, 0.5]
    )
    body = client.createMultiBody(0, shape, -1, [1, 2, 3], [0.1, 0.2, 0.3, 0.9])
    (mesh,) = listener.world.shapes_of(body)
    assert volume_m3(mesh.vertex_m, mesh.face) == pytest.approx(1e-3)
    assert mesh.vertex_m.min(axis=0) == pytest.approx([0, 0, 0.5])


def _volume(shape: Any) -> float:
    size = shape.size_m
    if shape.kind == "mesh":
        return float(volume_m3(shape.vertex_m, shape.face))
    if shape.kind == "box":
        return float(np.prod(size))
    return float(4 / 3 * np.pi * size[0] ** 3 if shape.kind == "sphere" else np.pi * size[0] ** 2 * size[1])


def test_equal_marbles_are_made_anew_but_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bullet tells no shape of bodies in maximal coordinates: each was loaded alone in a world, ten times over."""
    from sonic_bullet.simulators import direct_client, disconnect, kept_reduced_bodies
    from sonic_bullet.simulators.pybullet.colliding import given_bodies

    worlds: list[int] = []
    made_alone = given_bodies._made_alone

    def counted(*given: Any) -> tuple[int, int]:
        made = made_alone(*given)
        worlds.append(made[0])
        return made

    monkeypatch.setattr(given_bodies, "_made_alone", counted)
    client = direct_client()
    world = attach(client, microphone=()).world
    shapes = [client.createCollisionShape(p.GEOM_SPHERE, radius=radius) for radius in (0.1, 0.2)]
    bodies = [client.createMultiBody(1, shape, useMaximalCoordinates=1) for shape in shapes for _ in range(5)]
    with kept_reduced_bodies():
        sizes = [world.shapes_of(body, -1)[0].size_m[0] for body in bodies for _ in range(2)]
        assert len(worlds) == 2 and all(p.isConnected(one) for one in worlds)
    assert sizes == [0.1] * 10 + [0.2] * 10
    assert not any(p.isConnected(one) for one in worlds)
    disconnect(client)
