"""Joints of KHR_physics_rigid_bodies -> motors, and joints that PyBullet has between two bodies.

    locked turns, or none, and one drive of speed       -> SpeedDrive
    limits that lock all ways and all turns             -> fixed
                     all ways                           -> point
                     all ways, and all turns but one    -> hinge about that axis
                     all turns, and all ways but one    -> slider along that axis

Axes are those of the joint's node. Any other is named in notes, and so is the range of a motion that is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.checked_accessors import one_of
from sonic_bullet.records.rigid_scene import JointKind, RigidJoint, SpeedDrive
from sonic_bullet.session.gltf_in.node_frames import Nodes
from sonic_bullet.session.gltf_in.physics import KHR_PHYSICS

ALL_AXES = frozenset((0, 1, 2))


def joint_of(
    nodes: Nodes, index: int, number_of: Mapping[int, int], notes: list[str]
) -> SpeedDrive | RigidJoint | None:
    """Read a node's joint; None where it has none, or one that PyBullet lacks, which is named.

    number_of: bodies by the numbers of their nodes. Raises the tree's error.
    """
    apart_m = 1e-3
    said = nodes.extension(index, KHR_PHYSICS).get("joint")
    if said is None:
        return None
    name = nodes.name(index)
    known = nodes.tree.tree.get("extensions", {}).get(KHR_PHYSICS, {}).get("physicsJoints", ())
    joint = one_of(nodes.tree, known, said.get("joint"), f"{name}: joint")
    limits, drives = joint.get("limits", ()), joint.get("drives", ())
    owner = _body_above(nodes, index, number_of)
    if owner is not None and (drive := _drive(nodes, index, said, limits, drives, number_of, owner)) is not None:
        return drive
    kind, free = _kind_of(limits)
    if owner is None or kind is None or drives:
        kinds = sorted({axis for x in limits for axis in x if axis.endswith("Axes")})
        words = ", ".join([*kinds, *(f"{x.get('type')} drive" for x in drives)]) or "none"
        notes.append(f"{name}: its joint ({words}) is not simulated: PyBullet makes no such one between two bodies")
        return None
    other = said.get("connectedNode")
    one_of(nodes.tree, nodes.entry, other, f"{name}: connectedNode")
    placed, partner = nodes.place_node(index), _body_above(nodes, other, number_of)
    if np.linalg.norm(placed.position_m - nodes.place_node(other).position_m) > apart_m:
        notes.append(f"{name}: the ends of its joint are apart at the start: it holds them where its own node is")
    axis = placed.turn[:, free]
    return RigidJoint(
        kind=kind,
        body=owner,
        partner=-1 if partner is None else partner,
        position_m=placed.position_m,
        axis=axis / np.linalg.norm(axis),
        range=_range(limits, free, kind),
        collides=bool(said.get("enableCollision", False)),
    )


def _body_above(nodes: Nodes, index: int, number_of: Mapping[int, int]) -> int | None:
    owner = next((one for one in (index, *nodes.ancestors(index)) if one in number_of), None)
    return None if owner is None else number_of[owner]


def _locked_axes(limits: Sequence[Mapping[str, Any]], axes: str) -> frozenset[int]:
    """Axes of a kind along, or about, which nothing moves."""
    return frozenset(
        axis for x in limits if x.get("min") == x.get("max") == 0 and not x.get("stiffness") for axis in x.get(axes, ())
    )


def _kind_of(limits: Sequence[Mapping[str, Any]]) -> tuple[JointKind | None, int]:
    """Find the kind of joint that limits make, and the axis that they leave."""
    ways, turns = _locked_axes(limits, "linearAxes"), _locked_axes(limits, "angularAxes")
    if ways == ALL_AXES:
        kinds: dict[int, JointKind] = {0: "point", 2: "hinge", 3: "fixed"}
        return kinds.get(len(turns)), min(ALL_AXES - turns, default=0)
    if turns == ALL_AXES and len(ways) == 2:
        return "slider", min(ALL_AXES - ways)
    return None, 0


def _range(limits: Sequence[Mapping[str, Any]], free: int, kind: JointKind) -> tuple[float, float] | None:
    axes = {"hinge": "angularAxes", "slider": "linearAxes"}.get(kind, "")
    found = next((x for x in limits if x.get(axes) == [free]), None)
    if found is None or "min" not in found or "max" not in found:
        return None
    return float(found["min"]), float(found["max"])


def _drive(
    nodes: Nodes,
    index: int,
    said: Mapping[str, Any],
    limits: Sequence[Mapping[str, Any]],
    drives: Sequence[Mapping[str, Any]],
    number_of: Mapping[int, int],
    owner: int,
) -> SpeedDrive | None:
    """Read a joint as a motor, None where it is none."""
    locked = all(
        set(x.get("angularAxes", ())) == ALL_AXES and x.get("min") == x.get("max") == 0 and "linearAxes" not in x
        for x in limits
    )
    speed = len(drives) == 1 and drives[0].get("type") == "linear" and not drives[0].get("stiffness")
    if not (locked and speed and "velocityTarget" in drives[0]):
        return None
    drive: Mapping[str, Any] = drives[0]
    partner: Any = said.get("connectedNode")
    axis = nodes.place_node(index).turn[:, int(drive.get("axis", 0))]
    return SpeedDrive(
        body=owner,
        partner=number_of.get(partner, -1),
        direction=axis / np.linalg.norm(axis),
        speed_m_s=-drive["velocityTarget"],  # of the partner in the body's joint space
        damping_n_s_m=drive.get("damping", 0.0),
        most_n=drive.get("maxForce", 1e9),
        turns_locked=bool(limits),
    )
