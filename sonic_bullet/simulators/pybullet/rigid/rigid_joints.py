"""Joints between free bodies as PyBullet's constraints.

    fixed -> fixed      point -> point2point      slider -> prismatic
    hinge -> two points on its axis, 0.1 m apart: they leave the turn about it alone

PyBullet's constraints hold no range, and at most a force, which is set beyond any scene's.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import RigidJoint, RigidScene


def make_joints(client: Any, scene: RigidScene, ids: list[int]) -> tuple[str, ...]:
    """Hold the bodies of a scene together; ids: of its bodies. Notes on what PyBullet does not hold."""
    notes = []
    for joint in scene.joints:
        ends = [ids[joint.body], ids[joint.partner] if joint.partner >= 0 else -1]
        name = scene.bodies[joint.body].name
        for place in _places(joint):
            _constrain(client, joint, ends, place)
        if not joint.collides and ends[1] >= 0:
            client.setCollisionFilterPair(*ends, -1, -1, 0)
        if joint.range is not None:
            notes.append(f"{joint.kind} of {name}: its range is not simulated: PyBullet holds none between two bodies")
    return tuple(notes)


def _places(joint: RigidJoint) -> list[Array]:
    if joint.kind != "hinge":
        return [joint.position_m]
    hinge_m = 0.1
    return [joint.position_m + side * hinge_m / 2 * joint.axis for side in (-1, 1)]


def _constrain(client: Any, joint: RigidJoint, ends: list[int], place: Array) -> None:
    most_n = 1e9
    kind = {
        "fixed": client.JOINT_FIXED,
        "point": client.JOINT_POINT2POINT,
        "hinge": client.JOINT_POINT2POINT,
        "slider": client.JOINT_PRISMATIC,
    }[joint.kind]
    pivots, turns, axis = [], [], joint.axis
    for end in ends:
        if end < 0:
            pivots.append(place.tolist())
            turns.append([0.0, 0.0, 0.0, 1.0])
            continue
        position, turn = client.getBasePositionAndOrientation(end)
        frame = np.array(client.getMatrixFromQuaternion(turn)).reshape(3, 3)
        pivots.append((frame.T @ (place - position)).tolist())
        turns.append(client.invertTransform([0, 0, 0], turn)[1])
        if end == ends[0]:
            axis = frame.T @ joint.axis
    made = client.createConstraint(
        ends[0], -1, ends[1], -1, kind, axis.tolist(), pivots[0], pivots[1], turns[0], turns[1]
    )
    client.changeConstraint(made, maxForce=most_n)
