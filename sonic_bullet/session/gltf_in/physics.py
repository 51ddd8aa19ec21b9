"""KHR_physics_rigid_bodies and KHR_implicit_shapes -> colliders, motion, friction, drives [Khronos, drafts of 2024-26].

    motion: mass, centerOfMass, inertiaDiagonal, inertiaOrientation, linearVelocity, angularVelocity, gravityFactor
    collider: geometry (shape | mesh), physicsMaterial: dynamicFriction, restitution, their combine rules
    joints: joints.py

What is none of these is named in notes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.files.gltf.checked_accessors import one_of
from sonic_bullet.files.gltf.gltf_meshes import mesh_triangles
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.rigid_scene import PhysicsMaterial
from sonic_bullet.session.gltf_in.node_frames import UPRIGHT, Nodes

# extensions of glTF that are read and written
KHR_PHYSICS = "KHR_physics_rigid_bodies"
KHR_SHAPES = "KHR_implicit_shapes"
KHR_AUDIO = "KHR_audio_rigid_bodies"


@dataclass(frozen=True, slots=True, eq=False)
class BodyFrame:
    """Where a body's frame is: centre (3,) and turn (3, 3), world; and in its node, centre before its scale."""

    centre_m: Array
    turn: Array
    local_centre: Array
    local_turn: Array


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """What moves a body. mass_kg None: not said."""

    mass_kg: float | None
    inertia_kg_m2: Array
    velocity_m_s: Array
    spin_rad_s: Array
    gravity_factor: float


def body_nodes(nodes: Nodes) -> dict[int, list[int]]:
    """Find each body's node and its colliders': what moves, or sounds, with what hangs on it, else each by itself."""
    found: dict[int, list[int]] = {}
    for i in nodes.in_scene():
        own = nodes.extension(i, KHR_PHYSICS)
        if "motion" in own:
            found.setdefault(i, [])
        if "collider" in own:
            chain = (i, *nodes.ancestors(i))
            mover = next((one for one in chain if "motion" in nodes.extension(one, KHR_PHYSICS)), None)
            if mover is None:
                mover = next((one for one in chain if KHR_AUDIO in nodes.entry[one].get("extensions", {})), i)
            found.setdefault(mover, []).append(i)
    return found


def body_frame(nodes: Nodes, index: int) -> BodyFrame:
    """Of a node's body: at its centre of mass, along its principal axes."""
    from scipy.spatial.transform import Rotation

    placed, said = nodes.place_node(index), nodes.extension(index, KHR_PHYSICS).get("motion", {})
    centre = _vector(said, "centerOfMass", f"{nodes.name(index)}: centerOfMass")
    turn = Rotation.from_quat(said.get("inertiaOrientation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    return BodyFrame(placed.position_m + placed.turn @ (placed.scale * centre), placed.turn @ turn, centre, turn)


def motion_of(nodes: Nodes, index: int, notes: list[str]) -> BodyMotion:
    """Read a node's `motion`; without one, a body stands still."""
    motion = {"isKinematic", "mass", "centerOfMass", "inertiaDiagonal", "inertiaOrientation"} | {
        "linearVelocity",
        "angularVelocity",
        "gravityFactor",
        "extensions",
        "extras",
    }
    name, own = nodes.name(index), nodes.extension(index, KHR_PHYSICS)
    said = own.get("motion")
    zero = np.zeros(3)
    if said is None:
        return BodyMotion(0.0, zero, zero, zero, 1.0)
    notes += [f"{name}: motion.{key} is not known" for key in sorted(set(said) - motion)]
    if said.get("isKinematic"):  # it follows its animation, or stands still
        return BodyMotion(0.0, zero, zero, zero, 1.0)
    turn = nodes.place_node(index).turn  # velocities are in the node's space [KHR_physics_rigid_bodies, Motions]
    mass = said.get("mass")
    return BodyMotion(
        None if mass is None else as_number(mass, f"{name}: mass", "give kilograms above 0", above=0),
        _vector(said, "inertiaDiagonal", f"{name}: inertiaDiagonal"),
        turn @ _vector(said, "linearVelocity", f"{name}: linearVelocity"),
        turn @ _vector(said, "angularVelocity", f"{name}: angularVelocity"),
        as_number(said.get("gravityFactor", 1.0), f"{name}: gravityFactor", "give a number"),
    )


def _vector(said: Mapping[str, Any], key: str, name: str) -> Array:
    values = said.get(key, (0.0, 0.0, 0.0))
    return np.array([as_number(x, name, "give three numbers") for x in values], float).reshape(3)


def collider_shapes(nodes: Nodes, collider: int, frame: BodyFrame, notes: list[str]) -> list[Shape]:
    """Read a collider's geometry in its body's frame, scaled as its node is."""
    from scipy.spatial.transform import Rotation

    tree, name = nodes.tree, nodes.name(collider)
    said = nodes.extension(collider, KHR_PHYSICS)["collider"]
    known_fields = {"geometry", "physicsMaterial", "extensions", "extras"}
    notes += [f"{name}: collider.{key} is not simulated" for key in sorted(set(said) - known_fields)]
    placed, geometry = nodes.place_node(collider), said.get("geometry", {})
    position = frame.turn.T @ (placed.position_m - frame.centre_m)
    turn = frame.turn.T @ placed.turn

    def quaternion(more: Array | None = None) -> Array:
        return np.asarray(Rotation.from_matrix(turn if more is None else turn @ more).as_quat())

    if "shape" not in geometry:
        vertex, face = mesh_triangles(tree, _mesh_of(nodes, geometry, name))
        if len(vertex) < 4:
            raise tree.error(f"{name}: the mesh of its collider is flat or none", tree.remedy)
        return [
            Shape("mesh", position_m=position, quaternion_xyzw=quaternion(), vertex_m=vertex * placed.scale, face=face)
        ]
    known = tree.tree.get("extensions", {}).get(KHR_SHAPES, {}).get("shapes", ())
    shape = one_of(tree, known, geometry["shape"], f"{name}: shape")
    kind = str(shape.get("type"))
    own = shape.get(kind, {})
    if kind == "box":
        size = np.array(own.get("size", (1.0, 1.0, 1.0)), float) * placed.scale
        _check_lengths(nodes, name, size)
        return [Shape("box", size, position, quaternion())]
    # turns a shape whose axis is z so that it is y
    up_to_y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    if kind == "plane":
        if "sizeX" in own or "sizeZ" in own:
            notes.append(f"{name} is a plane of finite size: it is endless here")
        return [Shape("plane", np.zeros(3), position, quaternion(up_to_y))]
    if kind not in ("sphere", "capsule", "cylinder"):
        raise tree.error(f"{name}: its shape is a {kind}", "give a box, sphere, capsule, cylinder, plane or mesh")
    if not placed.uniform:
        raise tree.error(f"{name}: a {kind} of uneven scale", "scale it evenly, or give a mesh")
    scale = float(placed.scale[0])
    if kind == "sphere":
        radius = as_number(own.get("radius", 0.5), f"{name}: radius", "give metres above 0", above=0)
        return [Shape("sphere", np.array([radius * scale, 0.0, 0.0]), position, quaternion())]
    ends = [as_number(own.get(key, 0.25), f"{name}: {key}", "give metres") for key in ("radiusTop", "radiusBottom")]
    if ends[0] != ends[1]:
        notes.append(f"{name}: a {kind} that narrows is not simulated: both its ends have the mean radius")
    height = as_number(own.get("height", 0.5), f"{name}: height", "give metres above 0", above=0)
    size = np.array([sum(ends) / 2 * scale, height * scale, 0.0])
    _check_lengths(nodes, name, size[:2])
    return [Shape("capsule" if kind == "capsule" else "cylinder", size, position, quaternion(up_to_y))]


def _check_lengths(nodes: Nodes, name: str, size: Array) -> None:
    if not (np.isfinite(size).all() and (size > 0).all()):
        raise nodes.tree.error(f"{name}: a length of its shape is not above 0", "give metres above 0")


def _mesh_of(nodes: Nodes, geometry: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    index = geometry.get("mesh")
    if "node" in geometry:
        index = one_of(nodes.tree, nodes.entry, geometry["node"], f"{name}: node").get("mesh")
    return one_of(nodes.tree, nodes.tree.tree.get("meshes", ()), index, f"{name}: mesh")


def physics_of(nodes: Nodes, colliders: list[int], name: str, notes: list[str]) -> PhysicsMaterial:
    """Friction and restitution of a body's colliders: those of the first."""
    known = nodes.tree.tree.get("extensions", {}).get(KHR_PHYSICS, {}).get("physicsMaterials", ())
    indices = [nodes.extension(i, KHR_PHYSICS)["collider"].get("physicsMaterial") for i in colliders]
    if len(set(indices)) > 1:
        notes.append(f"{name} has several physics materials: that of its first collider counts")
    if not indices or indices[0] is None:
        return PhysicsMaterial()
    said = one_of(nodes.tree, known, indices[0], f"{name}: physicsMaterial")
    sliding = said.get("dynamicFriction", 0.6)
    if (static := said.get("staticFriction", sliding)) != sliding:
        words = f"static friction {static:g} is not simulated: PyBullet has one, the dynamic {sliding:g} is taken"
        if words not in notes:
            notes.append(words)
    return PhysicsMaterial(
        sliding,
        said.get("restitution", 0.0),
        said.get("frictionCombine", "average"),
        said.get("restitutionCombine", "average"),
    )


GRAVITY_M_S2 = UPRIGHT @ np.array([0.0, -9.81, 0.0])
"""KHR_physics_rigid_bodies leaves gravity to the engine; y is up."""
