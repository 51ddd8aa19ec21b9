"""Paths of bodies as a glTF animation [Khronos, glTF 2.0 Specification, 2021, sec. 3.11, C.4].

LINEAR samplers: on the line between positions, on the shorter arc between rotations. Both targets of a path share the
accessor of its times, and paths of the same times share it, too. Keys that lie on the way between their neighbours to
float32 are left out only where a body rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sonic_bullet.apps.bake.scene_out.y_up import place_y_up, turn_y_up
from sonic_bullet.files.gltf.gltf_writer import GltfBuffer
from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import BodyPath


def animation_of(paths: Sequence[BodyPath], node_of: Sequence[int], buffer: GltfBuffer) -> dict[str, Any] | None:
    """Write all paths as one animation; node_of: a body's node. None without any."""
    animation_name = "recorded motion"
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    known: dict[bytes, int] = {}
    for path in paths:
        turn = turn_y_up(path.quaternion_xyzw)
        turn = turn * _same_side(turn)[:, None]
        values = {"translation": place_y_up(path.position_m), "rotation": turn}
        for target, value in values.items():
            if (value == value[0]).all():
                continue
            keep = _mark_needed_keys(value.astype(np.float32))
            time = np.ascontiguousarray(path.time_s[keep])
            if time.tobytes() not in known:
                known[time.tobytes()] = buffer.append(time)
            sampler = {"input": known[time.tobytes()], "output": buffer.append(value[keep]), "interpolation": "LINEAR"}
            channels.append({"sampler": len(samplers), "target": {"node": node_of[path.body], "path": target}})
            samplers.append(sampler)
    return {"name": animation_name, "channels": channels, "samplers": samplers} if channels else None


def _same_side(turn: Array) -> Array:
    """Signs (t,) that keep quaternions (t, 4) on one side of the sphere from key to key."""
    step = np.where((turn[1:] * turn[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    return np.concatenate([[1.0], np.cumprod(step)])


def _mark_needed_keys(value: Array) -> Array:
    """Which keys (t,) are needed: the ends, and who differs from either neighbour."""
    same = (value[1:] == value[:-1]).all(axis=1)
    inner = ~(same[:-1] & same[1:])
    return np.concatenate([[True], inner, [True]]) if len(value) > 1 else np.ones(len(value), bool)
