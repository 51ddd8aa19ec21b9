"""A .gltf or .glb with KHR_physics_rigid_bodies -> RigidScene.

tree -> a body a node that moves, and a body a collider that does not -> shapes, motion, material, model -> RigidBody
     -> joints, drives, animations -> paths;  what is not understood -> notes

A dynamic body with an acoustic material and no model is solved here where no body of the file has a model; else it is
silent on purpose [Attaching to Nodes].
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sonic_bullet.files.gltf.gltf_tree import GltfTree, read_tree
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.geometry import shape_volume_m3
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.file_endings import GLTF_ENDINGS
from sonic_bullet.records.rigid_scene import RigidBody, RigidJoint, RigidScene, SpeedDrive, Viewpoint
from sonic_bullet.session.gltf_in.acoustics import audio_of, material_of, model_of, said_of
from sonic_bullet.session.gltf_in.animations import paths_of
from sonic_bullet.session.gltf_in.joints import joint_of
from sonic_bullet.session.gltf_in.node_frames import Nodes
from sonic_bullet.session.gltf_in.own_words import FREE, own_mounting
from sonic_bullet.session.gltf_in.physics import (
    GRAVITY_M_S2,
    KHR_AUDIO,
    KHR_PHYSICS,
    KHR_SHAPES,
    body_frame,
    body_nodes,
    collider_shapes,
    motion_of,
    physics_of,
)

GLTF_REMEDY = "export it again as glTF 2.0 with KHR_physics_rigid_bodies"


def is_gltf(path: str | os.PathLike[str]) -> bool:
    """Whether it is a glTF by its name."""
    return Path(path).suffix.lower() in GLTF_ENDINGS


def read_rigid_scene(path: str | os.PathLike[str]) -> RigidScene:
    """Bodies, materials and models of a scene. Raises FileError, SceneError, RecordError, each one line."""
    bytes_max = 1 << 30
    with reading_file(path, "glTF scene", SceneError, GLTF_REMEDY):
        if Path(path).stat().st_size > bytes_max:
            raise SceneError(f"{path} is larger than a gigabyte", "split it")
        return _scene_of(read_tree(Path(path), SceneError, GLTF_REMEDY), Path(path).name)


def _scene_of(tree: GltfTree, name: str) -> RigidScene:
    read_extensions = {
        KHR_PHYSICS,
        KHR_SHAPES,
        KHR_AUDIO,
        "KHR_texture_transform",
        "KHR_mesh_quantization",
    }
    nodes, notes = Nodes(tree), list[str]()
    used = [str(x) for x in tree.tree.get("extensionsUsed", ())]
    # beginnings of extensions that only change what is seen
    looks_extensions = ("KHR_materials_", "KHR_lights_", "KHR_texture_", "EXT_texture_", "EXT_meshopt", "KHR_xmp")
    notes += [
        f"{name} uses {x}, which is not read"
        for x in used
        if x not in read_extensions and not x.startswith(looks_extensions)
    ]
    found = body_nodes(nodes)
    if not found:
        raise SceneError(f"{name} has no rigid body: its extensions are {', '.join(used) or 'none'}", GLTF_REMEDY)
    modelled = bool(audio_of(nodes).get("modalModels"))
    bodies: list[RigidBody] = []
    number_of: dict[int, int] = {}
    for index, colliders in found.items():
        if not colliders:
            notes.append(f"{nodes.name(index)} moves and has no collider: it is left out")
            continue
        number_of[index] = len(bodies)
        bodies.append(_body(nodes, index, colliders, modelled, notes))
    joined = [joint_of(nodes, index, number_of, notes) for index in nodes.in_scene()]
    paths = paths_of(nodes, number_of, bodies, notes)
    drives = tuple(one for one in joined if isinstance(one, SpeedDrive))
    joints = tuple(one for one in joined if isinstance(one, RigidJoint))
    weighed, gravity = _shared_gravity(bodies)
    viewpoint = viewpoint_of(nodes, number_of, bodies)
    return RigidScene(weighed, drives, gravity, _once(notes), joints, paths, viewpoint)


def _shared_gravity(bodies: Sequence[RigidBody]) -> tuple[tuple[RigidBody, ...], Array]:
    """Take a gravityFactor that all that moves has for the scene's gravity."""
    factors = {body.gravity_factor for body in bodies if body.mass_kg > 0}
    if len(factors) != 1:
        return tuple(bodies), GRAVITY_M_S2
    return tuple(replace(body, gravity_factor=1.0) for body in bodies), GRAVITY_M_S2 * factors.pop()


def viewpoint_of(nodes: Nodes, number_of: Mapping[int, int], bodies: Sequence[RigidBody]) -> Viewpoint | None:
    """Return the first camera of the default scene: who gives no listener hears a scene from where it is looked at.

    It moves with the body on which its node hangs.
    """
    from scipy.spatial.transform import Rotation

    index = next((i for i in nodes.in_scene() if "camera" in nodes.entry[i]), None)
    if index is None:
        return None
    place, turn = nodes.camera_pose(index)
    bearer = next((number_of[one] for one in (index, *nodes.ancestors(index)) if one in number_of), -1)
    if bearer >= 0:
        frame = Rotation.from_quat(bodies[bearer].quaternion_xyzw).as_matrix()
        place, turn = frame.T @ (place - bodies[bearer].position_m), frame.T @ turn
    return Viewpoint(nodes.name(index), place, Rotation.from_matrix(turn).as_quat(), bearer)


def _once(notes: Sequence[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(notes))


def _body(nodes: Nodes, index: int, colliders: list[int], modelled: bool, notes: list[str]) -> RigidBody:
    from scipy.spatial.transform import Rotation

    name, frame, motion = nodes.name(index), body_frame(nodes, index), motion_of(nodes, index, notes)
    shapes = [shape for one in colliders for shape in collider_shapes(nodes, one, frame, notes)]
    physics = physics_of(nodes, colliders, name, notes)
    said, owner = said_of(nodes, index, colliders, notes)
    material, bulk = material_of(nodes, said, index, physics, notes)
    model, mounting = None, FREE
    if "modalModel" in said and material is not None:
        mounting = own_mounting(nodes.extension(owner, KHR_AUDIO))
        model, residual = model_of(nodes, said["modalModel"], owner, frame, motion.mass_kg, bulk, mounting, notes)
        material = replace(material, includes_radiation=True, residual=residual)
    mass = motion.mass_kg
    if mass is None:
        mass = model.mass_kg if model is not None and model.mass_kg else _solid_mass(shapes, bulk)
        notes.append(f"{name} says no mass: {mass:.4g} kg is taken")
    solved = mass > 0 and model is None and bool(bulk) and not modelled
    if "modalModel" not in said and material is not None and mass > 0 and modelled:
        notes.append(f"{name} has no modal model: it touches and does not ring")
    return RigidBody(
        name, tuple(shapes), mass, motion.inertia_kg_m2, frame.centre_m, Rotation.from_matrix(frame.turn).as_quat(),
        motion.velocity_m_s, motion.spin_rad_s, physics, motion.gravity_factor, material, model, solved,
        said.get("gain", 1.0), mounting,
    )  # fmt: skip


def _solid_mass(shapes: Sequence[Shape], bulk: Mapping[str, Any]) -> float:
    """Of shapes without a model: their volume by their material's density, or water's."""
    return float(sum(map(shape_volume_m3, shapes)) * bulk.get("density", 1000.0))
