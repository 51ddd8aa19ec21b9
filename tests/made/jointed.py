"""A two-link arm in PyBullet, its closed form, and a tap on its tip."""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet as p

import sonic_bullet as sb
from sonic_bullet.records import Array
from tests.made.models import STEEL, ball_body, box_model

LENGTH_M, MASS_KG, SIDE_M = (0.3, 0.2), (0.9, 0.5), 0.02
TAPPED_M = 0.08
"""Along the second link from its middle."""
FAR_HZ = (90_000.0,)
"""No mode in the band: the links are rigid."""


def make_arm(client: Any) -> int:
    """Make the arm, straight along x, hinges about z at 0 and at the first link's end; the second is link 1."""
    shapes = [
        client.createCollisionShape(p.GEOM_BOX, halfExtents=[one / 2, SIDE_M / 2, SIDE_M / 2],
                                    collisionFramePosition=[one / 2, 0, 0])
        for one in LENGTH_M
    ]  # fmt: skip
    arm = client.createMultiBody(
        0, -1, -1, [0, 0, 0],
        linkMasses=list(MASS_KG), linkCollisionShapeIndices=shapes, linkVisualShapeIndices=[-1, -1],
        linkPositions=[[0, 0, 0], [LENGTH_M[0], 0, 0]], linkOrientations=[[0, 0, 0, 1]] * 2,
        linkInertialFramePositions=[[one / 2, 0, 0] for one in LENGTH_M],
        linkInertialFrameOrientations=[[0, 0, 0, 1]] * 2, linkParentIndices=[0, 1],
        linkJointTypes=[p.JOINT_REVOLUTE] * 2, linkJointAxis=[[0, 0, 1]] * 2,
    )  # fmt: skip
    for joint in range(2):
        client.setJointMotorControl2(arm, joint, p.VELOCITY_CONTROL, force=0)
    return int(arm)


def tap_arm(client: Any) -> tuple[int, int]:
    """Make the arm, and a steel ball that is about to tap its tip at 1 m/s along y; return both."""
    client.setGravity(0, 0, 0)
    arm = make_arm(client)
    ball = client.createMultiBody(
        0.05, client.createCollisionShape(p.GEOM_SPHERE, radius=0.01),
        basePosition=[LENGTH_M[0] + LENGTH_M[1] / 2 + TAPPED_M, -0.0205, 0],
    )  # fmt: skip
    for body, link in ((arm, 0), (arm, 1), (ball, -1)):
        client.changeDynamics(
            body, link, restitution=0.5, contactProcessingThreshold=0, linearDamping=0, angularDamping=0,
            jointDamping=0,
        )  # fmt: skip
    client.resetBaseVelocity(ball, [0, 1.0, 0])
    return arm, ball


def arm_cast() -> dict[int, dict[str, Any]]:
    """Keywords of `add` by link."""
    models = [box_model((length, SIDE_M, SIDE_M), FAR_HZ) for length in LENGTH_M]
    return {link: {"material": STEEL, "model": model} for link, model in enumerate(models)}


def tapped_arm(client: Any, sensors: Any, steps: int = 24, springs: Any = None) -> sb.Listener:
    """Listen to the tapped arm; springs: of its joints, see `hold_joints`."""
    arm, ball = tap_arm(client)
    listener = sb.attach(client, microphone=sensors)
    if springs:
        listener.world.hold_joints(arm, springs)
    for link, how in arm_cast().items():
        listener.add(arm, link, **how)
    listener.add(ball, material=STEEL, model=ball_body(0.01).model)
    for _ in range(steps):
        client.stepSimulation()
    return listener


def transfer_per_kg(struck_m: tuple[float, float], felt_m: tuple[float, float]) -> float:
    """Speed along y at a place per impulse along y at another, J M⁻¹ Jᵀ of the straight double pendulum.

    Places: (distance from the first hinge, from the second; NaN where the link before it is meant).
    """
    rows: Array = np.nan_to_num(np.array([felt_m, struck_m]))
    return float(rows[0] @ np.linalg.solve(mass_matrix(), rows[1]))


def held_transfer(f: Array, struck_m: tuple[float, float], felt_m: tuple[float, float], springs: Array) -> Array:
    """Compute the same at frequencies in Hz of joints held by springs k (1 + iη): jω J (K − ω²M)⁻¹ Jᵀ."""
    omega = 2 * np.pi * f
    dynamic = np.diag(springs) - (omega**2)[:, None, None] * mass_matrix()
    right = np.broadcast_to(np.array(struck_m, complex)[:, None], (len(f), 2, 1))
    return np.asarray(1j * omega * (np.linalg.solve(dynamic, right)[:, :, 0] @ np.array(felt_m)))


def mass_matrix() -> Array:
    """Compute M (2, 2) of the straight double pendulum."""
    (l1, _), (m1, m2) = LENGTH_M, MASS_KG
    a1, a2 = LENGTH_M[0] / 2, LENGTH_M[1] / 2
    i1, i2 = (m * (one**2 + SIDE_M**2) / 12 for m, one in zip(MASS_KG, LENGTH_M, strict=True))
    both = i2 + m2 * (a2**2 + l1 * a2)
    return np.array([[i1 + m1 * a1**2 + i2 + m2 * (l1**2 + a2**2 + 2 * l1 * a2), both], [both, i2 + m2 * a2**2]])
