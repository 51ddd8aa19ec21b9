"""glTF 2.0 and GLB with node animations -> Export [Khronos, glTF 2.0 Specification, 2021; sections in brackets].

    JSON, buffers (GLB chunk, data URI, file beside it) -> accessors [3.6.2]
    nodes -> their meshes, samplers STEP, LINEAR, CUBICSPLINE [3.11, C.1-C.5] -> global transforms a frame

What is read is rigid motion of meshes: a constant scale is part of the mesh; one that changes, a skin or a morph is
refused. y is up and a metre is 1 [3.4]; here z is up: (x, -z, y), as in Blender before its export. Material,
restitution, friction, mass_kg, driven in a node's `extras` (Blender: custom properties) count as stated, and so do mass
and isKinematic of KHR_physics_rigid_bodies.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet.apps.soundtrack.frame_rates import rate_of_keys
from sonic_bullet.apps.soundtrack.score.export import Export, ExportedObject, Rule
from sonic_bullet.apps.soundtrack.score.keyframes import tip_orientations, upright
from sonic_bullet.files.gltf.gltf_animation import STRETCH, Sampler, local_transforms, read_channels
from sonic_bullet.files.gltf.gltf_meshes import mesh_triangles
from sonic_bullet.files.gltf.gltf_tree import GltfTree, read_tree
from sonic_bullet.files.storage.reading import reading_file
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import AnimationError

ANIMATION_REMEDY = "export it again as glTF 2.0 (.glb)"


def read_gltf(path: str | os.PathLike[str], fps: float | None = None, scale: float = 1.0) -> Export:
    """Read the rigid bodies of a .gltf or .glb, each frame of its animations.

    fps: of the frames; None: that of its keyframes. scale: of lengths. Raises FileError, AnimationError.
    """
    late_s = 1e-3
    place = Path(path)
    most_bytes = 1 << 30
    most_poses = 2_000_000  # of all nodes: half a gigabyte while they are read
    with reading_file(path, "glTF file", AnimationError, ANIMATION_REMEDY):
        if place.stat().st_size > most_bytes:
            raise AnimationError(f"{path} is larger than a gigabyte", "export fewer frames")
        file = read_tree(place, AnimationError, ANIMATION_REMEDY)
        channels = read_channels(file)
        if not channels:
            raise AnimationError(
                f"{path} holds no node animation", "bake the simulation to keyframes and export with animations"
            )
        times = [sampler.time_s for own in channels.values() for sampler in own.values()]
        rate = fps if fps is not None else rate_of_keys(times)
        first, last = min(t[0] for t in times), max(t[-1] for t in times)
        count = int(np.floor((last - first) * rate + 1e-3)) + 1
        many = max(len(_find_needed_nodes(file)), 1)
        if not 0 < count * many <= most_poses:
            raise AnimationError(
                f"{path} has {count} frames of {many} nodes, {most_poses} poses are the most",
                "export a shorter take, or give a lower --fps",
            )
        at_s = first + np.arange(count) / rate
        notes = [f"the first key is at {first:.3f} s: the sound begins there"] * bool(first > late_s)
        objects = tuple(_objects(file, channels, at_s, scale, notes))
        return Export(rate, objects, np.array([0.0, 0.0, -9.81]), tuple(notes))


def _parents(file: GltfTree) -> dict[int, int]:
    return {child: i for i, node in enumerate(file.tree.get("nodes", ())) for child in node.get("children", ())}


def _find_needed_nodes(file: GltfTree) -> set[int]:
    """Return the nodes that have a mesh, and their ancestors."""
    parent, found = _parents(file), set[int]()
    for one, node in enumerate(file.tree.get("nodes", ())):
        at: int | None = one if "mesh" in node else None
        while at is not None and at not in found:
            found.add(at)
            at = parent.get(at)
    return found


def _objects(
    file: GltfTree, channels: Mapping[int, Mapping[str, Sampler]], at_s: Array, scale: float, notes: list[str]
) -> Iterator[ExportedObject]:
    nodes, parent = file.tree.get("nodes", []), _parents(file)
    known: dict[int, Array] = {}

    def world(i: int, depth: int = 0) -> Array:
        """Compute the global transform (t, 4, 4) of a node."""
        if depth > len(nodes):
            raise AnimationError("its nodes hang on themselves", ANIMATION_REMEDY)
        if i not in known:
            own = local_transforms(nodes[i], channels.get(i, {}), at_s)
            known[i] = world(parent[i], depth + 1) @ own if i in parent else own
        return known[i]

    taken: set[str] = set()
    for i, node in enumerate(nodes):
        if "mesh" not in node:
            continue
        name = str(node.get("name") or f"node {i}")
        while name in taken:
            name += "'"
        taken.add(name)
        if "skin" in node:
            notes.append(f"{name} is skinned, which is no rigid motion: it is left out")
            continue
        vertex, face = mesh_triangles(file, file.tree["meshes"][node["mesh"]])
        if not len(face):
            notes.append(f"{name} has no triangles: it is left out")
            continue
        matrix = world(i)
        stretch, place, turn = _rigid(name, matrix)
        if not node.get("children"):
            del known[i], matrix
        yield ExportedObject(
            name,
            upright(place * scale, "y"),
            tip_orientations(turn),
            (vertex @ stretch.T * scale, face),
            stated=_read_statement(name, node),
        )


def _rigid(name: str, matrix: Array) -> tuple[Array, Array, Array]:
    """Split a transform (t, 4, 4) into a constant (3, 3), positions (t, 3) and rotations (t, 4).

    M = R S with S that of the first frame [polar decomposition, Shoemake & Duff 1992].
    """
    from scipy.linalg import polar
    from scipy.spatial.transform import Rotation

    stretch = polar(matrix[0, :3, :3])[1]
    if not np.linalg.det(stretch) > 1e-18:
        raise AnimationError(f"{quote(name)} has a scale of zero", "apply the scale before the export")
    frame = matrix[:, :3, :3] @ np.linalg.inv(stretch)
    if np.linalg.det(frame[0]) < 0:  # mirrored: the mirror belongs to the mesh
        stretch, frame = -stretch, -frame
    wrong = np.abs(np.einsum("tij,tik->tjk", frame, frame) - np.eye(3)).max(axis=(1, 2))
    if wrong.max() > 2 * STRETCH:
        raise AnimationError(
            f"{quote(name)} changes its size at frame {int(wrong.argmax())}", "animate position and rotation alone"
        )
    return stretch, matrix[:, :3, 3].copy(), Rotation.from_matrix(frame).as_quat()


def _read_statement(name: str, node: Mapping[str, Any]) -> Rule:
    """Read what a node states of itself; values of another type are skipped."""
    extras: Mapping[str, Any] = node["extras"] if isinstance(node.get("extras"), dict) else {}
    body = (node.get("extensions") or {}).get("KHR_physics_rigid_bodies") or {}
    motion = body.get("motion") or {}

    def number(value: object) -> float | None:
        real = isinstance(value, (int, float)) and not isinstance(value, bool)
        return float(value) if real and 0 <= value < 1e6 else None  # type: ignore[arg-type,operator]

    mass = number(extras.get("mass_kg"))
    driven = extras.get("driven", motion.get("isKinematic"))
    material = extras.get("material")
    return Rule(
        name,
        material if isinstance(material, str) else None,
        number(extras.get("restitution")),
        number(extras.get("friction")),
        number(motion.get("mass")) if mass is None else mass,
        bool(driven) if isinstance(driven, (bool, int)) else None,
    )
