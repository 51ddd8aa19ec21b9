"""RigidScene, what sounds of it, and its motion -> a glTF document.

body -> node: translation, rotation, mesh; KHR_physics_rigid_bodies: motion, collider; KHR_audio_rigid_bodies;
        KHR_audio_emitter, where clips are given
     -> nodes below it: further colliders, frames of joints
gravity (0, 0, -g) -> gravityFactor g/9.81 of all that moves: the extension leaves gravity to the engine, 9.81 down
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.baked_model import BakedMaterial, BakedModel
from sonic_bullet.apps.bake.gltf_audio import EXTENSION, GltfAudio, SoundIndices
from sonic_bullet.apps.bake.scene_out.colliders import Colliders, is_in_place, placed_as
from sonic_bullet.apps.bake.scene_out.emitters import EMITTER_EXTENSION, BodyClip, add_emitters
from sonic_bullet.apps.bake.scene_out.joint_entries import JointEntries
from sonic_bullet.apps.bake.scene_out.path_animation import animation_of
from sonic_bullet.apps.bake.scene_out.y_up import place_y_up, turn_y_up
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer, write_gltf
from sonic_bullet.geometry.shape_surfaces import joined_triangles
from sonic_bullet.records import Array
from sonic_bullet.records.mounting import Mounting
from sonic_bullet.records.rigid_scene import RigidBody, RigidScene
from sonic_bullet.session.gltf_in.own_words import EXTRAS
from sonic_bullet.session.gltf_in.physics import KHR_PHYSICS, KHR_SHAPES


@dataclass(frozen=True, slots=True, eq=False)
class BodySound:
    """What sounds of a body. model None: it does not ring; material None: a smooth, rigid partner."""

    model: BakedModel | None = None
    material: BakedMaterial | None = None
    gain: float = 1.0
    mounting: Mounting = "free"


def write_scene(
    path: str | os.PathLike[str], scene: RigidScene, sounds: Sequence[BodySound], clips: Sequence[BodyClip] = ()
) -> tuple[str, ...]:
    """Write a scene as .glb or .gltf, whole or not at all; return notes.

    Parameters
    ----------
    path, scene
        Where, and what.
    sounds
        Of its bodies.
    clips
        For viewers that play no modes.

    Raises
    ------
    FileError
    """
    document = _Document(scene)
    for number, (body, sound) in enumerate(zip(scene.bodies, sounds, strict=True)):
        document.add_body(number, body, sound)
    for joint in scene.joints:
        document.joints.add(joint, scene.bodies)
    document.emitters = add_emitters(clips, document.nodes, document.node_of, document.buffer)
    write_gltf(path, document.tree(), document.buffer)
    return document.notes


@dataclass(slots=True)
class _Document:
    """The lists of a document, and the nodes of bodies."""

    scene: RigidScene
    buffer: GltfBuffer = field(default_factory=GltfBuffer)
    nodes: list[dict[str, Any]] = field(default_factory=list)
    node_of: list[int] = field(default_factory=list)
    audio: GltfAudio = field(init=False)
    colliders: Colliders = field(init=False)
    joints: JointEntries = field(init=False)
    emitters: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        self.audio = GltfAudio(self.buffer)
        self.colliders = Colliders(self.audio)
        self.joints = JointEntries(self.nodes, self.node_of)
        g = self.scene.gravity_m_s2
        if np.abs(g[:2]).max() > 1e-9 * max(1.0, abs(float(g[2]))):
            words = ", ".join(f"{x:g}" for x in g)
            self.notes = (f"gravity is ({words}) m/s²: a glTF has none but along its y, z here",)

    def add_body(self, number: int, body: RigidBody, sound: BodySound) -> None:
        """Write a body's node, and those below it."""
        node: dict[str, Any] = {"name": body.name, **_format_pose(body.position_m, body.quaternion_xyzw)}
        self.node_of.append(len(self.nodes))
        self.nodes.append(node)
        sounding, own = self._write_sounding(body, sound)
        node["mesh"] = own[0]
        physics: dict[str, Any] = {}
        driven = any(path.body == number for path in self.scene.paths) and body.mass_kg <= 0
        if body.mass_kg > 0 or driven:
            physics["motion"] = {"isKinematic": True} if driven else self._motion(body)
        for shape in body.shapes:
            entry = {
                "geometry": self.colliders.geometry(shape, body.name, own),
                "physicsMaterial": self.colliders.physics_material(body.physics),
            }
            place, turn = placed_as(shape)
            if is_in_place(place, turn) and "collider" not in physics:
                physics["collider"] = entry
                continue
            node.setdefault("children", []).append(len(self.nodes))
            self.nodes.append(
                {
                    "name": f"{body.name} collider",
                    "translation": place.tolist(),
                    "rotation": turn.tolist(),
                    "extensions": {KHR_PHYSICS: {"collider": entry}},
                }
            )
        on_node: dict[str, Any] = sounding.node_entry | ({} if sound.gain == 1 else {"gain": sound.gain})
        if sound.model is not None and sound.mounting != "free":
            on_node["extras"] = {EXTRAS: {"mounting": sound.mounting}}
        node["extensions"] = ({KHR_PHYSICS: physics} if physics else {}) | {EXTENSION: on_node}

    def _write_sounding(self, body: RigidBody, sound: BodySound) -> tuple[SoundIndices, tuple[int, Array, Array]]:
        """Write what sounds of a body; with the mesh that it is drawn as."""
        if sound.model is not None:
            made = self.audio.add_model(sound.model)
            if made.mesh is not None:
                return made, (made.mesh, sound.model.point_m, sound.model.face)
        else:
            made = SoundIndices(None, None if sound.material is None else self.audio.add_material(sound.material), None)
        vertex, face = joined_triangles(body.shapes)
        return made, (self.audio.add_mesh(body.name, vertex, face), vertex, face)

    def _motion(self, body: RigidBody) -> dict[str, Any]:
        standard_m_s2 = 9.81
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_quat(np.array(body.quaternion_xyzw)).as_matrix()
        factor = -float(self.scene.gravity_m_s2[2]) / standard_m_s2 * body.gravity_factor
        found: dict[str, Any] = {"mass": body.mass_kg}
        if (body.inertia_kg_m2 > 0).all():
            found["inertiaDiagonal"] = body.inertia_kg_m2.tolist()
        found |= {
            "linearVelocity": (body.velocity_m_s @ turn).tolist(),
            "angularVelocity": (body.spin_rad_s @ turn).tolist(),
        }
        return found if factor == 1 else found | {"gravityFactor": factor}

    def tree(self) -> dict[str, Any]:
        """Return the whole document."""
        below = {child for node in self.nodes for child in node.get("children", ())}
        used: dict[str, Any] = {KHR_PHYSICS: {"physicsMaterials": self.colliders.materials}}
        if self.joints.entries:
            used[KHR_PHYSICS]["physicsJoints"] = self.joints.entries
        if self.colliders.shapes:
            used[KHR_SHAPES] = {"shapes": self.colliders.shapes}
        used[EXTENSION] = self.audio.document()
        if self.emitters:
            used[EMITTER_EXTENSION] = self.emitters
        animation = animation_of(self.scene.paths, self.node_of, self.buffer)
        return {
            "asset": {"version": "2.0", "generator": "sonic_bullet"},
            "extensionsUsed": list(used),
            "scene": 0,
            "scenes": [{"nodes": [i for i in range(len(self.nodes)) if i not in below]}],
            "nodes": self.nodes,
            "meshes": self.audio.meshes,
            **({"animations": [animation]} if animation else {}),
            "extensions": {key: entry for key, entry in used.items() if entry},
        }


def _format_pose(position_m: Array, quaternion_xyzw: Array) -> dict[str, Any]:
    return {"translation": place_y_up(position_m).tolist(), "rotation": turn_y_up(quaternion_xyzw).tolist()}
