"""Joints between bodies as KHR_physics_rigid_bodies has them: limits about and along the axes of a node.

    fixed: no way, no turn      point: no way      hinge: no way, a turn about x alone      slider: a way along x alone

The frame of a joint is a node below either body, or a node of the scene where the partner is the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.scene_out.y_up import place_y_up, turn_y_up
from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import RigidBody, RigidJoint
from sonic_bullet.session.gltf_in.physics import KHR_PHYSICS


@dataclass(slots=True)
class JointEntries:
    """The joints of a document, each kind and range once. nodes: all of it; node_of: a body's."""

    nodes: list[dict[str, Any]]
    node_of: list[int]
    entries: list[dict[str, Any]] = field(default_factory=list)

    def add(self, joint: RigidJoint, bodies: Sequence[RigidBody]) -> None:
        """Write a joint and the nodes of its frames."""
        entry = {"limits": _limits(joint)}
        if entry not in self.entries:
            self.entries.append(entry)
        name = f"{joint.kind} of {bodies[joint.body].name}"
        other = self._frame(joint, joint.partner, bodies, f"{name}, partner")
        own = self._frame(joint, joint.body, bodies, name)
        said = {"connectedNode": other, "joint": self.entries.index(entry), "enableCollision": joint.collides}
        self.nodes[own]["extensions"] = {KHR_PHYSICS: {"joint": said}}

    def _frame(self, joint: RigidJoint, number: int, bodies: Sequence[RigidBody], name: str) -> int:
        """Write a node at a joint, below a body or in the scene; return its number."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(_frame_of(joint.axis))
        if number < 0:
            place, quaternion = place_y_up(joint.position_m), turn_y_up(turn.as_quat())
        else:
            body = bodies[number]
            back = Rotation.from_quat(np.array(body.quaternion_xyzw)).inv()
            place, quaternion = back.apply(joint.position_m - body.position_m), (back * turn).as_quat()
            self.nodes[self.node_of[number]].setdefault("children", []).append(len(self.nodes))
        self.nodes.append({"name": name, "translation": place.tolist(), "rotation": quaternion.tolist()})
        return len(self.nodes) - 1


def _limits(joint: RigidJoint) -> list[dict[str, Any]]:
    ways = {"fixed": [0, 1, 2], "point": [0, 1, 2], "hinge": [0, 1, 2], "slider": [1, 2]}[joint.kind]
    turns = {"fixed": [0, 1, 2], "point": [], "hinge": [1, 2], "slider": [0, 1, 2]}[joint.kind]
    found: list[dict[str, Any]] = [{"linearAxes": ways, "min": 0.0, "max": 0.0}]
    if turns:
        found.append({"angularAxes": turns, "min": 0.0, "max": 0.0})
    if joint.range is not None:
        axes = "angularAxes" if joint.kind == "hinge" else "linearAxes"
        found.append({axes: [0], "min": joint.range[0], "max": joint.range[1]})
    return found


def _frame_of(axis: Array) -> Array:
    """Make a right-handed frame (3, 3) whose x is a unit vector: columns x, y, z."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    y = np.cross(axis, other)
    y /= np.linalg.norm(y)
    return np.stack([axis, y, np.cross(axis, y)], axis=1)
