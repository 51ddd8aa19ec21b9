"""Rigid motions of jointed bodies: their mass matrix is PyBullet's, and a push gives the speeds that PyBullet gives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as p
import pybullet_data
import pytest

from sonic_bullet.simulators.pybullet.jointed.joint_motions import jointed_body
from sonic_bullet.simulators.rigid_modes import JointedBody, jacobians, rigid_modes


def loaded(client: Any, name: str, *, fixed: bool) -> tuple[int, list[float]]:
    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    turn = p.getQuaternionFromEuler([0.1, 0.5, 0.3])
    body = client.loadURDF(name, [0.3, 0.2, 1.1], turn, useFixedBase=fixed)
    moving = [j for j in range(client.getNumJoints(body)) if client.getJointInfo(body, j)[2] != p.JOINT_FIXED]
    angles = np.random.default_rng(3).uniform(0.02, 0.6, len(moving)).tolist()
    for joint, angle in zip(moving, angles, strict=True):
        client.resetJointState(body, joint, angle)
        client.setJointMotorControl2(body, joint, p.VELOCITY_CONTROL, force=0)
    return body, angles


@pytest.mark.parametrize("name", ["franka_panda/panda.urdf", "kuka_iiwa/model.urdf", "r2d2.urdf"])
def test_the_mass_matrix_is_pybullets(client: Any, name: str) -> None:
    body, angles = loaded(client, name, fixed=True)
    found = jointed_body(client._client, body)
    j = jacobians(found)
    weight = np.concatenate([np.repeat(found.mass_kg[:, None], 3, axis=1), found.inertia_kg_m2], axis=1)
    mass = np.einsum("lxd,lx,lxe->de", j, weight, j)
    theirs = np.array(client.calculateMassMatrix(body, angles))
    assert np.abs(mass - theirs).max() < 1e-6 * np.abs(theirs).max()


def test_a_free_robot_moves_as_pybullet_moves_it(client: Any) -> None:
    """A force of one short step on a link: the base's speed and the joints' follow from Ψ Ψᵀ."""
    client.setGravity(0, 0, 0)
    client.setTimeStep(1e-4)
    body, _ = loaded(client, "r2d2.urdf", fixed=False)
    for link in range(-1, client.getNumJoints(body)):
        client.changeDynamics(body, link, linearDamping=0, angularDamping=0, jointDamping=0)
    shape, rate, _ = rigid_modes(jointed_body(client._client, body))
    pushed, force = 8, np.array([3.0, -2.0, 5.0])
    turn = np.reshape(client.getMatrixFromQuaternion(client.getLinkState(body, pushed)[1]), (3, 3))
    client.applyExternalForce(body, pushed, force.tolist(), client.getLinkState(body, pushed)[0], p.WORLD_FRAME)
    client.stepSimulation()
    wrench = np.concatenate([turn.T @ force * 1e-4, np.zeros(3)])
    speed = np.einsum("dx,dy,y->x", shape[:, 0], shape[:, pushed + 1], wrench)
    base = np.reshape(client.getMatrixFromQuaternion(client.getBasePositionAndOrientation(body)[1]), (3, 3))
    measured = np.concatenate([base.T @ np.array(one) for one in client.getBaseVelocity(body)])
    assert not rate.any() and np.abs(measured - speed).max() < 0.01 * np.abs(measured).max()


def test_a_joint_with_stiffness_swings_at_its_rate() -> None:
    """A rod on a hinge: ω = √(k/(I + m a²)), d = ηω/2, and the tip's mobility stays that of the free hinge."""
    mass, length, stiffness = 0.8, 0.4, 500.0
    moment = mass * length**2 / 12
    rod = JointedBody(
        np.array([[0.0, 0, 0], [length / 2, 0, 0]]), np.stack([np.eye(3)] * 2), np.array([0, mass]),
        np.array([[0.0, 0, 0], [1e-6, moment, moment]]), np.array([[False, True]]), np.array([[0.0, 0, 1]]),
        np.zeros((1, 3)), np.array([True]), False, np.array([stiffness]), np.array([0.04]),
    )  # fmt: skip
    shape, rate, decay = rigid_modes(rod)
    about_hinge = moment + mass * length**2 / 4
    assert rate == pytest.approx([np.sqrt(stiffness / about_hinge)])
    assert decay == pytest.approx(0.02 * rate)
    tip = shape[0, 1] @ np.array([0, 1, 0, 0, 0, length / 2])
    assert tip**2 == pytest.approx(length**2 / about_hinge)
