# SPDX-FileCopyrightText: 2026 the authors of sonic_bullet
# SPDX-License-Identifier: GPL-3.0-or-later
"""Poses of a scene's rigid bodies at whole frames, as keyframes that `sonic-bullet score` reads.

Active bodies with mass, friction and bounciness as Blender has them, animated ones as driven, passive ones as what
never moves. Only whole frames: Blender keeps no substeps, and interpolates between frames; `score` finds the touches.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

FORMAT = "sonic-bullet-animation/1"


def sounding_objects(scene: bpy.types.Scene) -> list[Any]:
    """Return the objects that can touch: meshes with a rigid body."""
    return [item for item in scene.objects if item.type == "MESH" and item.rigid_body]


def write_poses(scene: bpy.types.Scene, path: Path) -> Iterator[float]:
    """Write the frames of a scene; yields how far it is, 0 to 1, after each frame, for an interface that goes on."""
    items, was = sounding_objects(scene), scene.frame_current
    graph = bpy.context.evaluated_depsgraph_get()
    positions, turns = [], []
    scene.frame_set(scene.frame_start)
    header = {
        "format": FORMAT,
        "fps": scene.render.fps / scene.render.fps_base,
        "unit_m": scene.unit_settings.scale_length,
        "gravity_m_s2": list(scene.gravity) if scene.use_gravity else [0.0, 0.0, 0.0],
        "bodies": [_body(item, graph) for item in items],
    }
    count = scene.frame_end - scene.frame_start + 1
    try:
        for number in range(count):
            scene.frame_set(scene.frame_start + number)
            poses = [item.evaluated_get(graph).matrix_world.decompose() for item in items]
            positions.append([list(place) for place, _, _ in poses])
            turns.append([[turn.x, turn.y, turn.z, turn.w] for _, turn, _ in poses])
            yield (number + 1) / count
    finally:
        scene.frame_set(was)
    text = np.frombuffer(json.dumps(header).encode(), np.uint8)
    np.savez(path, header=text, position=np.array(positions), quaternion_xyzw=np.array(turns))


def _body(item: Any, graph: Any) -> dict[str, Any]:
    """Return what the file says of an object, without its poses."""
    rigid, chosen = item.rigid_body, item.sonic_bullet
    said = {
        "name": item.name,
        "mesh": _mesh(item, graph),
        "restitution": rigid.restitution,
        "friction": rigid.friction,
        "driven": bool(rigid.kinematic),
    }
    if rigid.type == "ACTIVE":
        said["mass_kg"] = rigid.mass
    material = bpy.path.abspath(chosen.preset) if chosen.material == "FILE" else chosen.material
    if material and material != "NONE":
        said["material"] = material
    return said


def _mesh(item: Any, graph: Any) -> dict[str, Any]:
    """Return vertices and triangles as modifiers leave them, scaled, in the object's frame."""
    evaluated = item.evaluated_get(graph)
    shape = evaluated.to_mesh()
    shape.calc_loop_triangles()
    scale = np.array(item.matrix_world.to_scale())
    vertices = np.array([corner.co for corner in shape.vertices]) * scale
    faces = [list(face.vertices) for face in shape.loop_triangles]
    evaluated.to_mesh_clear()
    return {"vertices": vertices.tolist(), "faces": faces}
