"""The pieces a link's collision geometry is made of, as PyBullet describes them, placed in the body frame.

getCollisionShapeData has no answer for bodies in maximal coordinates and for height fields. For the first their visual
shape stands in, which is the collision shape unless another was asked for; the second are left out.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pybullet

from sonic_bullet.listener.quiet import quiet_stdout
from sonic_bullet.records import Array

KINDS = {
    pybullet.GEOM_SPHERE,
    pybullet.GEOM_BOX,
    pybullet.GEOM_CYLINDER,
    pybullet.GEOM_MESH,
    pybullet.GEOM_PLANE,
    pybullet.GEOM_CAPSULE,
}


class Piece(NamedTuple):
    """kind: pybullet.GEOM_…; size (3): as getCollisionShapeData's dimensions; file: mesh file or ""; position (3),
    quaternion (4): body frame.
    """

    kind: int
    size: Any
    file: str
    position: Any
    quaternion: Any


def turn_matrix(quaternion_xyzw: Any) -> Array:
    """Rotation matrix (3, 3) of a quaternion."""
    return np.array(pybullet.getMatrixFromQuaternion(quaternion_xyzw)).reshape(3, 3)


def collision_pieces(client_id: int, body: int, link: int) -> tuple[Piece, ...]:
    """Pieces of an existing link; none where it cannot be touched or PyBullet cannot say how."""
    with quiet_stdout():
        try:
            shapes = pybullet.getCollisionShapeData(body, link, physicsClientId=client_id)
        except pybullet.error:
            return tuple(piece for piece in visual_pieces(client_id, body, link) if piece.kind in KINDS)
    return tuple(
        Piece(kind, size, _name(file), position, quaternion) for _, _, kind, size, file, position, quaternion in shapes
    )


def visual_pieces(client_id: int, body: int, link: int) -> tuple[Piece, ...]:
    """Visual shapes of an existing link: PyBullet places them in the link frame, and the body frame is the inertial
    one within it.
    """
    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
    back, turn = pybullet.invertTransform(info[3], info[4])
    pieces = []
    for entry in pybullet.getVisualShapeData(body, physicsClientId=client_id):
        if entry[1] == link:
            position, quaternion = pybullet.multiplyTransforms(back, turn, entry[5], entry[6])
            pieces.append(Piece(entry[2], entry[3], _name(entry[4]), position, quaternion))
    return tuple(pieces)


def _name(file: bytes) -> str:
    name = file.decode(errors="replace")
    return "" if name == "unknown_file" else name
