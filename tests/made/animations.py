"""Animations as an exporter writes them: a box and a ball that PyBullet drops on a floor, as arrays, GLB and JSON."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.export import Export, ExportedObject
from sonic_bullet.records import Array, Shape
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.animated import AnimatedBody

EDGES_M = (0.08, 0.05, 0.03)
RADIUS_M, MASS_KG = 0.02, 0.1
FLOOR_M = (1.0, 1.0, 0.1)


def box_mesh(edges_m: Sequence[float]) -> tuple[Array, Array]:
    """Vertices (8, 3) and triangles (12, 3), outwards, of a box about the origin."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(edges_m) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def ball_body(name: str = "ball", mass_kg: float = MASS_KG, restitution: float = 0.7) -> AnimatedBody:
    inertia = np.full(3, 0.4 * mass_kg * RADIUS_M**2)
    return AnimatedBody(name, (Shape("sphere", np.array([RADIUS_M, 0, 0])),), mass_kg, inertia, restitution)


def floor_body() -> AnimatedBody:
    return AnimatedBody("floor", (Shape("box", np.array(FLOOR_M)),), 0.0, np.zeros(3))


def ball_animation(height_m: Array, fps: float, **options: Any) -> Animation:
    """A ball above a floor, its centre at these heights (t,) over the floor's face."""
    place = np.zeros((len(height_m), 2, 3))
    place[:, 0, 2], place[:, 1, 2] = -FLOOR_M[2] / 2, height_m
    turn = np.broadcast_to([0.0, 0, 0, 1], (len(height_m), 2, 4))
    return Animation(fps, (floor_body(), ball_body(**options)), place, turn)


def bounce_m(time_s: Array, drop_m: float, restitution: float, gravity: float = 9.81) -> Array:
    """Heights (t,) of a ball's centre that falls from rest and bounces once, in closed form."""
    fall_s = np.sqrt(2 * drop_m / gravity)
    speed = restitution * gravity * fall_s
    after = time_s - fall_s
    return RADIUS_M + np.where(
        after < 0, drop_m - gravity * time_s**2 / 2, speed * after - gravity * after**2 / 2
    )  # fmt: skip


@dataclass(frozen=True)
class Keys:
    """Poses at `fps`. position_m (t, 3), quaternion_xyzw (t, 4): of meshes' origins; extras: custom properties."""

    fps: float
    mesh: Mapping[str, tuple[Array, Array]]
    position_m: Mapping[str, Array]
    quaternion_xyzw: Mapping[str, Array]
    extras: Mapping[str, dict[str, Any]] = field(default_factory=dict)


@cache
def dropped(fps: int = 240, seconds: float = 0.6) -> Keys:
    """A box and a floor; poses as PyBullet has them at 240 Hz."""
    client = direct_client()
    try:
        client.setGravity(0, 0, -9.81)
        half = [[e / 2 for e in edges] for edges in (FLOOR_M, EDGES_M)]
        shapes = [client.createCollisionShape(client.GEOM_BOX, halfExtents=one) for one in half]
        ground = client.createMultiBody(0, shapes[0], basePosition=[0, 0, -FLOOR_M[2] / 2])
        turn = client.getQuaternionFromEuler([0.2, 0.1, 0])
        mass = 1000 * float(np.prod(EDGES_M))
        box = client.createMultiBody(mass, shapes[1], basePosition=[0, 0, 0.1], baseOrientation=turn)
        for one in (ground, box):
            client.changeDynamics(one, -1, restitution=0.7, lateralFriction=0.7, contactProcessingThreshold=0)
        poses = [client.getBasePositionAndOrientation(box)]
        for _ in range(round(seconds * 240)):
            client.stepSimulation()
            poses.append(client.getBasePositionAndOrientation(box))
    finally:
        disconnect(client)
    kept = poses[:: 240 // fps]
    still = np.array([0, 0, -FLOOR_M[2] / 2])
    return Keys(
        float(fps),
        {"floor": box_mesh(FLOOR_M), "box": box_mesh(EDGES_M)},
        {"floor": np.broadcast_to(still, (len(kept), 3)), "box": np.array([p for p, _ in kept])},
        {"floor": np.broadcast_to([0.0, 0, 0, 1], (len(kept), 4)), "box": np.array([q for _, q in kept])},
    )  # fmt: skip


def export_of(keys: Keys) -> Export:
    """The same as a reader gives it."""
    objects = [
        ExportedObject(name, keys.position_m[name], keys.quaternion_xyzw[name], mesh)
        for name, mesh in keys.mesh.items()
    ]
    return Export(keys.fps, tuple(objects), np.array([0, 0, -9.81]))


def y_up(vector: Array) -> Array:
    """(x, z, -y), as Blender exports."""
    return np.stack([vector[..., 0], vector[..., 2], -vector[..., 1]], axis=-1)


def write_glb(path: Path, keys: Keys, *, animated: bool = True, length: float = 1.0) -> None:
    """A GLB with y up, one node a mesh; length: metres to a unit."""
    data, views, accessors = bytearray(), [], []

    def add(array: Array, kind: str, component: int, dtype: str) -> int:
        raw = np.ascontiguousarray(array, dtype).tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(raw)})
        data.extend(raw + b"\0" * (-len(raw) % 4))
        accessors.append({"bufferView": len(views) - 1, "componentType": component, "count": len(array), "type": kind})
        return len(accessors) - 1

    nodes, meshes, channels, samplers = [], [], [], []
    frames = len(next(iter(keys.position_m.values())))
    time = add(np.arange(frames) / keys.fps, "SCALAR", 5126, "<f4")
    for number, (name, (vertex, face)) in enumerate(keys.mesh.items()):
        place, turn = y_up(keys.position_m[name]) / length, keys.quaternion_xyzw[name]
        turn = np.concatenate([y_up(turn[:, :3]), turn[:, 3:]], axis=1)
        attributes = {"POSITION": add(y_up(vertex) / length, "VEC3", 5126, "<f4")}
        index = add(face.reshape(-1, 1), "SCALAR", 5125, "<u4")
        meshes.append({"primitives": [{"attributes": attributes, "indices": index}]})
        node = {"name": name, "mesh": number, "translation": place[0].tolist(), "rotation": turn[0].tolist()}
        if name in keys.extras:
            node["extras"] = keys.extras[name]
        nodes.append(node)
        if np.ptp(place, axis=0).max() > 0:
            for what, value, kind in (("translation", place, "VEC3"), ("rotation", turn, "VEC4")):
                samplers.append({"input": time, "output": add(value, kind, 5126, "<f4")})
                channels.append({"sampler": len(samplers) - 1, "target": {"node": number, "path": what}})
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"}, "nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }  # fmt: skip
    if animated:
        tree["animations"] = [{"channels": channels, "samplers": samplers}]
    write_tree(path, tree, bytes(data))


def write_tree(path: Path, tree: dict[str, Any], data: bytes) -> None:
    """A JSON tree and its bytes as a GLB."""
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
    parts = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    path.write_bytes(head + parts)


def keyframes(keys: Keys) -> dict[str, Any]:
    """The same as the JSON that `score` reads."""
    return {
        "format": "sonic-bullet-animation/1",
        "fps": keys.fps,
        "bodies": [
            {
                "name": name,
                "mesh": {"vertices": vertex.tolist(), "faces": face.tolist()},
                "position": keys.position_m[name].tolist(),
                "quaternion_xyzw": keys.quaternion_xyzw[name].tolist(),
                **keys.extras.get(name, {}),
            }
            for name, (vertex, face) in keys.mesh.items()
        ],
    }
