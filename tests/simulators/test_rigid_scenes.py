"""Joints and kinematic bodies of a RigidScene in PyBullet, and a world read back as one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonic_bullet.records import Array, Shape
from sonic_bullet.records.rigid_scene import BodyPath, JointKind, RigidBody, RigidJoint, RigidScene
from sonic_bullet.simulators import direct_client
from sonic_bullet.simulators.pybullet.rigid.kinematic_bodies import pose_at
from sonic_bullet.simulators.pybullet.rigid.rigid_world import build_rigid_scene
from sonic_bullet.simulators.pybullet.rigid.world_scene import read_world_scene

NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])
X, Y = np.eye(3)[:2]
DOWN = np.array([0.0, 0.0, -9.81])


def box(name: str, place: Any, mass_kg: float = 1.0, spin: Any = (0.0, 0.0, 0.0)) -> RigidBody:
    shape = Shape("box", np.array([0.1, 0.06, 0.04]))
    return RigidBody(name, (shape,), mass_kg, np.zeros(3), np.array(place, float), NO_TURN, np.zeros(3), np.array(spin))


def run(scene: RigidScene, seconds: float) -> tuple[Array, Array]:
    """Positions (b, 3) and orientations (b, 4) of its bodies then."""
    client = direct_client()
    ids, act, _ = build_rigid_scene(client, scene)
    for _ in range(round(240 * seconds)):
        act()
        client.stepSimulation()
    found = [client.getBasePositionAndOrientation(one) for one in ids]
    return np.array([x[0] for x in found]), np.array([x[1] for x in found])


def angle(quaternion: Array) -> float:
    return float(2 * np.arctan2(np.linalg.norm(quaternion[:3]), abs(quaternion[3])))


@pytest.mark.parametrize(
    ("kind", "gravity"), [("fixed", DOWN), ("point", DOWN), ("hinge", DOWN), ("slider", DOWN), ("slider", 3 * X)]
)
def test_a_joint_to_the_world_leaves_the_motion_that_it_names(kind: JointKind, gravity: Array) -> None:
    """Off its centre, a body hangs still, swings, or goes along the axis alone, as a joint leaves it."""
    place = np.array([0.2, 0.0, 1.0])
    joint = RigidJoint(kind, 0, -1, np.array([0.0, 0.0, 1.0]), Y if kind == "hinge" else X)
    position, turn = run(RigidScene((box("one", place),), (), gravity, joints=(joint,)), 0.25)
    moved = position[0] - place
    arm = np.linalg.norm(position[0] - joint.position_m)
    if kind in ("fixed", "slider") and gravity is DOWN:
        assert np.abs(moved).max() < 2e-3 and angle(turn[0]) < 2e-2
    elif kind == "slider":
        assert moved[0] == pytest.approx(0.5 * 3 * 0.25**2, rel=0.05) and np.abs(moved[1:]).max() < 1e-3
    else:
        assert arm == pytest.approx(0.2, abs=2e-3) and moved[2] < -0.1 and abs(moved[1]) < 1e-3
        assert angle(turn[0]) > 0.5, "it turns with its arm"


@pytest.mark.parametrize("kind", ["fixed", "point", "hinge", "slider"])
def test_two_bodies_keep_their_momentum_and_their_joint(kind: JointKind) -> None:
    """Free in space, one of two spins: their common centre stays, the joint's place is one in both."""
    from scipy.spatial.transform import Rotation

    bodies = (box("one", [0, 0, 0], spin=[0, 0, 2.0] if kind != "slider" else [0, 0, 0]), box("two", [0.2, 0, 0]))
    joint = RigidJoint(kind, 0, 1, np.array([0.1, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]) if kind == "hinge" else X)
    position, turn = run(RigidScene(bodies, (), np.zeros(3), joints=(joint,)), 0.3)
    assert np.abs(position.mean(axis=0) - [0.1, 0, 0]).max() < 0.02
    ends = [
        p + Rotation.from_quat(q).apply(joint.position_m - b.position_m)
        for p, q, b in zip(position, turn, bodies, strict=True)
    ]
    assert np.abs(ends[0] - ends[1]).max() < 3e-3


def test_a_kinematic_body_is_on_its_path_and_pushes_what_it_meets() -> None:
    time = np.linspace(0, 1, 11)
    place = np.stack([0.5 * time, 0 * time, 0.3 + 0 * time], axis=1)
    half = 0.25 * np.pi * time
    turn = np.stack([0 * time, 0 * time, np.sin(half), np.cos(half)], axis=1)
    bodies = (box("lift", place[0], 0.0), box("thing", [0.0, 0.0, 0.36], 0.5))
    path = BodyPath(0, time, place, turn)
    position, turned = run(RigidScene(bodies, (), DOWN, paths=(path,)), 0.5)
    there, way = pose_at(path, 0.5)
    np.testing.assert_allclose(position[0], there, atol=1e-4)
    assert abs(turned[0] @ way) == pytest.approx(1, abs=1e-6)
    assert position[1][2] > 0.33 and position[1][0] > 0.1, "friction takes along what lies on it"


def test_a_world_is_read_as_the_scene_that_it_was_made_of() -> None:
    bodies = (box("one", [0, 0, 0.5]), box("two", [0.2, 0, 0.5]), box("floor", [0, 0, 0], 0.0))
    joints = (RigidJoint("point", 0, 1, np.array([0.1, 0.0, 0.5]), X), RigidJoint("slider", 1, -1, np.zeros(3), Y))
    client = direct_client()
    build_rigid_scene(client, RigidScene(bodies, (), DOWN, joints=joints))
    read = read_world_scene(client._client, lambda links: [f"{body}" for body, _, _ in links])
    assert [one.mass_kg for one in read.scene.bodies] == [1, 1, 0]
    np.testing.assert_array_equal(read.scene.gravity_m_s2, DOWN)
    for one, other in zip(read.scene.joints, joints, strict=True):
        assert (one.kind, one.body, one.partner) == (other.kind, other.body, other.partner)
        np.testing.assert_allclose(one.position_m, other.position_m, atol=1e-9)
        if one.kind == "slider":
            np.testing.assert_allclose(np.abs(one.axis), np.abs(other.axis), atol=1e-9)


def test_joints_of_a_robot_are_read_with_their_ranges() -> None:
    import pybullet_data

    client = direct_client()
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    client.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True)
    read = read_world_scene(client._client, lambda links: [f"{body}/{link}" for body, link, _ in links])
    hinges = [one for one in read.scene.joints if one.kind == "hinge"]
    assert len(hinges) == 7 and all(one.range is not None and one.range[0] < 0 < one.range[1] for one in hinges)
    assert all(one.mass_kg > 0 for one in read.scene.bodies[1:]) and read.scene.bodies[0].mass_kg == 0
