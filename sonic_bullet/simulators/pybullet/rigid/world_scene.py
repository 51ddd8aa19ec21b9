r"""A PyBullet world as it stands now -> RigidScene: bodies, friction and restitution, joints, gravity.

    every link with a collision shape -> shapes_of, getDynamicsInfo, pose and twist -> RigidBody (body frame: inertial)
    joints of multibodies: revolute, prismatic, spherical, fixed \
    createConstraint: point2point, fixed, prismatic               -> RigidJoint, its frame in the world now

PyBullet multiplies both bodies' friction, and so their restitution: the rule is "multiply". It does not report the
motors of joints and the damping of motion; what else a RigidScene lacks is named in notes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError
from sonic_bullet.records.rigid_scene import JointKind, PhysicsMaterial, RigidBody, RigidJoint, RigidScene
from sonic_bullet.simulators.frames import encode
from sonic_bullet.simulators.pybullet import body_facts as facts
from sonic_bullet.simulators.pybullet.clients import links_with_shapes
from sonic_bullet.simulators.pybullet.collision_shapes import shapes_of
from sonic_bullet.simulators.pybullet.poses import read_motion, read_roster
from sonic_bullet.simulators.pybullet.questions import settings, step_reader

JOINT_KINDS: dict[int, JointKind] = {
    pybullet.JOINT_REVOLUTE: "hinge",
    pybullet.JOINT_PRISMATIC: "slider",
    pybullet.JOINT_SPHERICAL: "point",
    pybullet.JOINT_FIXED: "fixed",
    pybullet.JOINT_POINT2POINT: "point",
}
Link = tuple[int, int]
"""Body and link, base -1."""


@dataclass(frozen=True, slots=True, eq=False)
class StandingScene:
    """A world's scene, and its links (body, link) in the order of its bodies."""

    scene: RigidScene
    links: tuple[Link, ...]


def read_world_scene(
    client_id: int, names: Callable[[Sequence[tuple[int, int, str | None]]], list[str]]
) -> StandingScene:
    """Read all links that have a shape; names: of links, as `World.record_names`. Raises SceneError, RecordError."""
    roster = read_roster(client_id)
    motion = read_motion(client_id, roster)
    row_of = {int(code): row for row, code in enumerate(roster.code)}
    with_shape = links_with_shapes(client_id)
    called = dict(zip(with_shape, names([(*link, None) for link in with_shape]), strict=True))
    notes: list[str] = [f"body {body} is soft: it is left out" for body in roster.soft]
    bodies: dict[Link, RigidBody] = {}
    for link, name in called.items():
        try:
            bodies[link] = _body(client_id, link, name, motion.row[row_of[int(encode(*link))]], notes)
        except MeshError as error:
            notes.append(f"{name} is left out: {error.what}")
    number = {link: i for i, link in enumerate(bodies)}
    joints = [*_link_joints(client_id, roster.bodies, number, notes), *_constraints(client_id, number, notes)]
    gravity = np.array(settings(client_id, step_reader(client_id), None).gravity_m_s2)
    made = RigidScene(tuple(bodies.values()), (), gravity, tuple(dict.fromkeys(notes)), tuple(joints))
    return StandingScene(made, tuple(bodies))


def _body(client_id: int, link: Link, name: str, row: Any, notes: list[str]) -> RigidBody:
    info = pybullet.getDynamicsInfo(*link, physicsClientId=client_id)
    if info[6] > 0 or info[7] > 0:
        notes.append(f"{name}: friction against rolling and spinning is not in the file")
    return RigidBody(
        name,
        shapes_of(client_id, *link),
        facts.checked_mass_kg(info, *link),
        np.array(info[2], float),
        row["position_m"],
        row["quaternion_xyzw"],
        row["velocity_m_s"],
        row["spin_rad_s"],
        PhysicsMaterial(info[1], min(max(info[5], 0.0), 1.0), "multiply", "multiply"),
    )


def _link_joints(
    client_id: int, bodies: Sequence[tuple[int, int, bool]], number: dict[Link, int], notes: list[str]
) -> list[RigidJoint]:
    """Read the joints by which links hang on each other."""
    found: list[RigidJoint] = []
    for body, count, _ in bodies:
        for link in range(count):
            info = pybullet.getJointInfo(body, link, physicsClientId=client_id)
            name, kind = info[1].decode(errors="replace"), JOINT_KINDS.get(info[2])
            state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client_id)
            ends = number.get((body, link)), number.get((body, info[16]))
            if kind is None or ends[0] is None or ends[1] is None:
                why = "PyBullet's kind of it is not written" if kind is None else "one of its links has no shape"
                notes.append(f"joint {name} is left out: {why}")
                continue
            axis = (
                _rotate_vector(state[5], np.array(info[13]))
                if kind in ("hinge", "slider")
                else np.array([1.0, 0.0, 0.0])
            )
            limits = None
            if kind in ("hinge", "slider"):
                now = pybullet.getJointState(body, link, physicsClientId=client_id)[0]
                if info[8] <= info[9]:
                    limits = (info[8] - now, info[9] - now)
                notes.append("motors and friction of joints are not in the file")
            found.append(RigidJoint(kind, ends[0], ends[1], np.array(state[4]), axis, limits))
    return found


def _constraints(client_id: int, number: dict[Link, int], notes: list[str]) -> list[RigidJoint]:
    """Read what createConstraint made."""
    found: list[RigidJoint] = []
    for i in range(pybullet.getNumConstraints(physicsClientId=client_id)):
        one = pybullet.getConstraintUniqueId(i, physicsClientId=client_id)
        info = pybullet.getConstraintInfo(one, physicsClientId=client_id)
        parent, child, kind = (info[0], info[1]), (info[2], info[3]), JOINT_KINDS.get(info[4])
        ends = number.get(parent), -1 if info[2] < 0 else number.get(child)
        if kind is None or ends[0] is None or ends[1] is None:
            why = "it is no point, fixed or prismatic one" if kind is None else "one of its links has no shape"
            notes.append(f"constraint {one} is left out: {why}")
            continue
        position, turn = _pose(client_id, *parent)
        axis = _rotate_vector(turn, np.array(info[5], float)) if kind == "slider" else np.array([1.0, 0.0, 0.0])
        place = position + _rotate_vector(turn, np.array(info[6]))
        found.append(RigidJoint(kind, ends[0], ends[1], place, axis / np.linalg.norm(axis), None, True))
    return found


def _pose(client_id: int, body: int, link: int) -> tuple[Array, Array]:
    ask: Any = pybullet
    if link < 0:
        found = ask.getBasePositionAndOrientation(body, physicsClientId=client_id)
    else:
        found = ask.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client_id)
    return np.array(found[0]), np.array(found[1])


def _rotate_vector(quaternion: Any, vector: Array) -> Array:
    made = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3) @ vector
    return np.asarray(made)
