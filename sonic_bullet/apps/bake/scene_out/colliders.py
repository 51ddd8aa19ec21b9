"""Shapes of bodies as colliders: KHR_implicit_shapes, or meshes of the document.

    box, sphere, capsule, cylinder, plane -> an implicit shape, each once; its axis is y, ours is z
    mesh                                  -> a mesh of the document: the body's own where it is the same triangles

A shape that stands as its body's frame does goes on the body's node, any other on a node below it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.gltf_audio import GltfAudio
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.rigid_scene import PhysicsMaterial


@dataclass(slots=True)
class Colliders:
    """Implicit shapes and physics materials of a document, each once."""

    audio: GltfAudio
    shapes: list[dict[str, Any]] = field(default_factory=list)
    materials: list[dict[str, Any]] = field(default_factory=list)

    def geometry(self, shape: Shape, name: str, own: tuple[int, Array, Array] | None) -> dict[str, int]:
        """Write a shape; own: number, vertices and triangles of the mesh that its body is drawn as."""
        if shape.kind == "mesh":
            if own is not None and np.array_equal(own[1], shape.vertex_m) and np.array_equal(own[2], shape.face):
                return {"mesh": own[0]}
            return {"mesh": self.audio.add_mesh(f"collider of {name}", shape.vertex_m, shape.face)}
        return {"shape": _once(self.shapes, _implicit(shape))}

    def physics_material(self, physics: PhysicsMaterial) -> int:
        """Write friction and restitution; PyBullet knows one friction."""
        entry = {
            "staticFriction": physics.friction,
            "dynamicFriction": physics.friction,
            "restitution": physics.restitution,
            "frictionCombine": physics.friction_rule,
            "restitutionCombine": physics.restitution_rule,
        }
        return _once(self.materials, entry)


def placed_as(shape: Shape) -> tuple[Array, Array]:
    """Position (3,) and quaternion (4,) of the glTF shape in its body's frame."""
    turn = shape.quaternion_xyzw
    if shape.kind in ("capsule", "cylinder", "plane"):
        from scipy.spatial.transform import Rotation

        turn = np.asarray((Rotation.from_quat(np.array(turn)) * Rotation.from_euler("x", 90, degrees=True)).as_quat())
    return shape.position_m, turn


def is_in_place(position_m: Array, quaternion_xyzw: Array) -> bool:
    """Whether a shape stands as its body's frame does."""
    return not position_m.any() and bool(abs(abs(quaternion_xyzw[3]) - 1) < 1e-12)


def _implicit(shape: Shape) -> dict[str, Any]:
    x, y, _ = shape.size_m.tolist()
    match shape.kind:
        case "box":
            return {"type": "box", "box": {"size": shape.size_m.tolist()}}
        case "sphere":
            return {"type": "sphere", "sphere": {"radius": x}}
        case "plane":
            return {"type": "plane", "plane": {}}
    return {"type": shape.kind, shape.kind: {"height": y, "radiusBottom": x, "radiusTop": x}}


def _once(entries: list[dict[str, Any]], entry: dict[str, Any]) -> int:
    if entry not in entries:
        entries.append(entry)
    return entries.index(entry)
