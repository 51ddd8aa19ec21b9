"""Shapes of an animated body as PyBullet's collision shapes; meshes as convex pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.machine.leftovers import temporary_folder
from sonic_bullet.records import Array, Shape
from sonic_bullet.simulators.animated import AnimatedBody
from sonic_bullet.simulators.pybullet.staged.mesh_parts import pieces


def compound(shapes: Sequence[dict[str, Any]], client_id: int) -> int:
    """Create a collision shape of one or several; several meshes pass through files, of which PyBullet makes hulls."""
    if len(shapes) == 1:
        return int(pybullet.createCollisionShape(**shapes[0], physicsClientId=client_id))
    with temporary_folder() as folder:
        names = [str(Path(folder, f"{number}.obj")) for number in range(len(shapes))]
        for name, shape in zip(names, shapes, strict=True):
            if "vertices" in shape:
                Path(name).write_text(_wavefront(np.array(shape["vertices"])), "ascii")
        made = pybullet.createCollisionShapeArray(
            shapeTypes=[one["shapeType"] for one in shapes],
            radii=[one.get("radius", 0.0) for one in shapes],
            halfExtents=[one.get("halfExtents", [0, 0, 0]) for one in shapes],
            lengths=[one.get("height", 0.0) for one in shapes],
            fileNames=[name if "vertices" in one else "" for name, one in zip(names, shapes, strict=True)],
            meshScales=[[1, 1, 1]] * len(shapes),
            collisionFramePositions=[one["collisionFramePosition"] for one in shapes],
            collisionFrameOrientations=[one["collisionFrameOrientation"] for one in shapes],
            physicsClientId=client_id,
        )
    return int(made)


def _wavefront(vertex: Array) -> str:
    """Write a hull's corners as a mesh file; its faces are arbitrary, as PyBullet takes the hull."""
    corners = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertex.tolist()]
    return "\n".join([*corners, *(f"f {i} {i + 1} {i + 2}" for i in range(1, len(vertex) - 1))]) + "\n"


def collision_options(shape: Shape, body: AnimatedBody) -> Iterator[dict[str, Any]]:
    """Yield createCollisionShapeArray's arguments for a shape; for a mesh, of its convex pieces."""
    placed = {
        "collisionFramePosition": shape.position_m.tolist(),
        "collisionFrameOrientation": shape.quaternion_xyzw.tolist(),
    }
    size = shape.size_m.tolist()
    if shape.kind == "sphere":
        yield {"shapeType": pybullet.GEOM_SPHERE, "radius": size[0], **placed}
    elif shape.kind == "box":
        yield {"shapeType": pybullet.GEOM_BOX, "halfExtents": [x / 2 for x in size], **placed}
    elif shape.kind in ("capsule", "cylinder"):
        kind = pybullet.GEOM_CAPSULE if shape.kind == "capsule" else pybullet.GEOM_CYLINDER
        yield {"shapeType": kind, "radius": size[0], "height": size[1], **placed}
    elif shape.kind == "plane":
        turn = np.array(pybullet.getMatrixFromQuaternion(shape.quaternion_xyzw)).reshape(3, 3)
        yield {"shapeType": pybullet.GEOM_PLANE, "planeNormal": turn[:, 2].tolist()}
    else:
        found = pieces(shape, body.name, body.mass_kg > 0)
        for corner in found:
            yield {"shapeType": pybullet.GEOM_MESH, "vertices": corner.tolist(), **placed}
        if not found:
            bare = {"vertices": shape.vertex_m.tolist(), "indices": shape.face.ravel().tolist()}
            yield {"shapeType": pybullet.GEOM_MESH, **bare, **placed}
