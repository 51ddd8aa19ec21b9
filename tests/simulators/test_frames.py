"""Poses, frames and records: contacts sit on the surface by the pose before the step; inertia belongs to the body
frame; ids are reused.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from sonic_bullet._engine import rotation_between
from sonic_bullet.records import Material
from sonic_bullet.simulators import direct_client, disconnect, open_world
from sonic_bullet.simulators.frames import rotate_orientations as turn_by
from tests.made.scenes import DUCK, floor, impulse_on, listen, thing, turned

STEEL = Material.isotropic("steel", youngs_pa=2e11, poisson=0.3, density_kg_m3=7800, alpha_per_s=1.0, beta_s=1e-8)


@pytest.mark.parametrize("hooked", [True, False])
def test_contacts_lie_on_the_surface_by_the_pose_before_the_step(client: Any, hooked: bool) -> None:
    """A box thrown with spin through an offset, turned inertial frame: every contact is on its surface within the
    overlap.
    """
    floor(client)
    body = client.createMultiBody(
        0.3,
        client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.05, 0.03]),
        basePosition=[0, 0, 0.15],
        baseInertialFramePosition=[0.02, 0.01, 0.03],
        baseInertialFrameOrientation=turned(0.3, 0.2, 0.5),
    )
    (box,) = open_world(client).shapes_of(body)
    client.resetBaseVelocity(body, [1, 0.5, -2], [10, 20, 5])
    world, steps = listen(client) if hooked else (open_world(client._client), [])
    for _ in range(240):
        client.stepSimulation()
        if not hooked:
            steps.append(world.after_step())
    index = world.index_of(body)
    turn = np.array(p.getMatrixFromQuaternion(box.quaternion_xyzw)).reshape(3, 3)
    seen = 0
    for rows in (s.contacts for s in steps):
        point = np.where((rows.a == index)[:, None], rows.point_a_m, rows.point_b_m)
        local = np.abs((point - box.position_m) @ turn)
        outside = (local - box.size_m / 2).max(axis=1)
        assert (np.abs(outside) < 2e-5).all()
        seen += len(rows)
    assert seen > 100


@pytest.mark.parametrize("maximal", [False, True])
def test_inertia_is_diagonal_in_the_body_frame(client: Any, maximal: bool) -> None:
    """Angular momentum R·I·Rᵀ·ω of a free spin stays put only if the diagonal belongs to the inertial frame."""
    client.setGravity(0, 0, 0)
    client.setTimeStep(1e-4)
    body = client.createMultiBody(
        1.0,
        client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.3, 0.1, 0.05]),
        baseInertialFramePosition=[0.1, 0.2, 0],
        baseInertialFrameOrientation=turned(0.4, 0.5, 0.6),
        useMaximalCoordinates=maximal,
    )
    client.changeDynamics(body, -1, linearDamping=0, angularDamping=0, localInertiaDiagonal=[0.01, 0.03, 0.05])
    inertia = open_world(client).add(body).inertia_kg_m2
    client.resetBaseVelocity(body, [0, 0, 0], [1, 2, 3])

    def spin() -> np.ndarray:
        turn = np.array(p.getMatrixFromQuaternion(client.getBasePositionAndOrientation(body)[1])).reshape(3, 3)
        return turn @ inertia @ turn.T @ np.array(client.getBaseVelocity(body)[1])

    start = spin()
    for _ in range(10_000):
        client.stepSimulation()
    assert np.linalg.norm(spin() - start) < 2e-3 * np.linalg.norm(start)
    assert inertia[0, 0] < 0.5 * inertia[2, 2]


def test_links_have_poses_speeds_and_rows_of_their_own(client: Any) -> None:
    """A ball dropped on a hanging arm: the rows name the link, whose twist is that of its centre of mass."""
    floor(client)
    robot = client.loadURDF(pybullet_data.getDataPath() + "/kuka_iiwa/model.urdf", useFixedBase=True)
    for joint in range(client.getNumJoints(robot)):
        client.resetJointState(robot, joint, 0.4, targetVelocity=0.7)
        client.setJointMotorControl2(robot, joint, p.VELOCITY_CONTROL, force=0)
    ball = thing(client, "sphere", [0.05, 0, 1.6])
    world, steps = listen(client)
    before, after = [], []
    for _ in range(200):
        before.append([state[0] for state in client.getLinkStates(robot, range(7), computeForwardKinematics=1)])
        client.stepSimulation()
        after.append(
            [
                state[6]
                for state in client.getLinkStates(robot, range(7), computeLinkVelocity=1, computeForwardKinematics=1)
            ]
        )
    links = {(x.body_id, x.link) for x in world.bodies}
    assert (ball, -1) in links
    assert any(body == robot and link >= 0 for body, link in links)
    moved = np.diff(np.array(before), axis=0) * 240
    np.testing.assert_allclose(moved[20:60], np.array(after)[20:60], atol=0.05)
    assert np.abs(moved[20:60]).max() > 0.8
    index = next(i for i, x in enumerate(world.bodies) if x.body_id == robot and x.link >= 0)
    link = world.bodies[index].link
    late = steps[-1].position_m[index]
    np.testing.assert_allclose(late, before[-1][link], atol=1e-12)


def test_listening_changes_nothing(client: Any) -> None:
    """Robot, ball and mesh move bit for bit as they do unheard."""

    def run(observed: bool) -> list[Any]:
        made = direct_client()
        made.setGravity(0, 0, -9.81)
        floor(made)
        robot = made.loadURDF(pybullet_data.getDataPath() + "/r2d2.urdf", [0, 0, 0.6])
        thing(made, "mesh", [0.1, 0, 1.5])
        thing(made, "sphere", [1, 0, 0.3])
        if observed:
            listen(made)
        for _ in range(240):
            made.stepSimulation()
        result = [made.getBasePositionAndOrientation(i) for i in range(4)] + [
            made.getJointState(robot, j)[:2] for j in range(15)
        ]
        disconnect(made)
        return result

    assert run(True) == run(False)
    assert client is not None


def test_static_bodies_and_strangers_get_records(client: Any) -> None:
    ground = floor(client)
    ball = thing(client, "sphere", [0, 0, 0.06])
    world, steps = listen(client)
    world.add(ball, material=STEEL)
    for _ in range(30):
        client.stepSimulation()
    assert {x.body_id for x in world.bodies} == {ground, ball}
    stranger = world.bodies[world.index_of(ground)]
    assert stranger.mass_kg == 0 and stranger.material is None and stranger.since_step > 0
    known = world.bodies[world.index_of(ball)]
    assert known.material is STEEL and known.curvature_per_m == pytest.approx(20)
    assert len(steps[0].position_m) == 1 and len(steps[-1].position_m) == 2


def test_adding_a_stranger_later_ends_its_silent_record(client: Any) -> None:
    floor(client)
    ball = thing(client, "sphere", [0, 0, 0.05])
    world, steps = listen(client)
    for _ in range(10):
        client.stepSimulation()
    silent = world.index_of(ball)
    world.add(ball, material=STEEL)
    for _ in range(10):
        client.stepSimulation()
    sounding = world.index_of(ball)
    assert sounding != silent
    assert world.bodies[silent].until_step == world.bodies[sounding].since_step == 10
    assert (np.concatenate([steps[5].contacts.a, steps[5].contacts.b]) == silent).any()
    assert (np.concatenate([steps[15].contacts.a, steps[15].contacts.b]) == sounding).any()
    np.testing.assert_allclose(steps[15].position_m[silent], steps[9].position_m[silent], atol=1e-6)


@pytest.mark.parametrize("hooked", [False, True])
def test_reused_ids_are_other_bodies(client: Any, hooked: bool) -> None:
    floor(client)
    world, _ = listen(client) if hooked else (open_world(client._client), [])

    def settle() -> None:
        for _ in range(30):
            client.stepSimulation()
            if not hooked:
                world.after_step()

    ball = thing(client, "sphere", [0, 0, 0.05])
    settle()
    first = world.index_of(ball)
    p.removeBody(ball, physicsClientId=client._client) if not hooked else client.removeBody(ball)
    box = thing(client, "box", [0.3, 0, 0.03])
    settle()
    second = world.index_of(box)
    assert box == ball
    assert second != first
    assert world.bodies[first].until_step == 30
    assert world.bodies[second].epoch > world.bodies[first].epoch


def test_reset_ends_everything_and_begins_anew(client: Any) -> None:
    floor(client)
    ball = thing(client, "sphere", [0, 0, 0.05])
    world, steps = listen(client)
    world.add(ball, material=STEEL)
    for _ in range(10):
        client.stepSimulation()
    client.resetSimulation()
    client.setGravity(0, 0, -9.81)
    assert all(x.until_step == 10 for x in world.bodies)
    again = thing(client, "sphere", [0, 0, 0.05])
    floor(client)
    for _ in range(10):
        client.stepSimulation()
    assert world.bodies[world.index_of(again)].epoch > world.bodies[0].epoch
    assert impulse_on(world, steps[-1], again)[2] > 0
    assert len(steps[-1].position_m) == 2 and steps[-1].body.tolist() == [2, 3]


def test_forget_serves_where_no_hook_can(client: Any) -> None:
    floor(client)
    ball = thing(client, "sphere", [0, 0, 0.05])
    world = open_world(client._client)
    for _ in range(3):
        client.stepSimulation()
        world.after_step()
    old = world.index_of(ball)
    client.removeBody(ball)
    world.forget(ball)
    second = thing(client, "sphere", [0, 0, 0.05])
    client.stepSimulation()
    world.after_step()
    assert second == ball
    assert world.index_of(second) not in (old, -1)


def test_rotations_between_and_by_are_inverse() -> None:
    rng = np.random.default_rng(0)
    first = rng.normal(size=(50, 4))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    vector = rng.normal(size=(50, 3))
    vector *= (rng.uniform(0, 3, 50) / np.linalg.norm(vector, axis=1))[:, None]
    second, found = turn_by(first, vector), np.empty_like(vector)
    for i in range(50):
        rotation_between(first[i], second[i], found[i])
    np.testing.assert_allclose(found, vector, atol=1e-12)


def test_mesh_frames_follow_offset_and_turned_inertial_frames(client: Any) -> None:
    """A mesh under a collision offset and an inertial frame of its own: the file's vertices hold the hull's."""
    body = client.createMultiBody(
        1,
        client.createCollisionShape(
            p.GEOM_MESH,
            fileName=DUCK,
            meshScale=[0.1, 0.2, 0.1],
            collisionFramePosition=[1, 0, 0],
            collisionFrameOrientation=turned(0, 0, 1),
        ),
        baseInertialFramePosition=[0.1, 0.2, 0.3],
        baseInertialFrameOrientation=turned(0.2, 0, 0),
    )
    (shape,) = open_world(client).shapes_of(body)
    hull = np.array(client.getMeshData(body, -1, 0)[1])
    placed = (
        shape.vertex_m @ np.array(p.getMatrixFromQuaternion(shape.quaternion_xyzw)).reshape(3, 3).T + shape.position_m
    )
    nearest = np.array([np.linalg.norm(placed - v, axis=1).min() for v in hull])
    assert nearest.max() < 1e-3
    assert len(shape.face) > 4000
