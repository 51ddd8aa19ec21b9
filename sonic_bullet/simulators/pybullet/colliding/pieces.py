"""Pieces of a link's collision geometry, as PyBullet describes them, placed in the body frame.

getCollisionShapeData ends the process on capsules that an MJCF file gives by their ends: they are read from the file
(mjcf_capsules). It has no answer for bodies in maximal coordinates: the same body in reduced ones is queried
(given_bodies), else the visual shape replaces it, where it fills the same space. Height fields are left out.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pybullet

from sonic_bullet.records import Array
from sonic_bullet.simulators.pybullet.colliding.filled_space import fills
from sonic_bullet.simulators.pybullet.colliding.given_bodies import is_maximal, reduced_body
from sonic_bullet.simulators.pybullet.colliding.mjcf_capsules import must_not_be_asked, read_capsules
from sonic_bullet.simulators.quiet import quiet_stdout


class Piece(NamedTuple):
    """A piece of a link.

    Parameters
    ----------
    kind
        pybullet.GEOM_…
    size : shape (3,)
        getCollisionShapeData's dimensions.
    file
        Mesh file or "".
    position, quaternion : shapes (3,), (4,)
        Body frame.
    """

    kind: int
    size: Any
    file: str
    position: Any
    quaternion: Any


UNKNOWN = -1
NOBODY_KNOWS = (Piece(UNKNOWN, (0.0, 0.0, 0.0), "", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),)


def turn_matrix(quaternion_xyzw: Any) -> Array:
    """Convert a quaternion to a rotation matrix (3, 3)."""
    return np.array(pybullet.getMatrixFromQuaternion(quaternion_xyzw)).reshape(3, 3)


def collision_pieces(client_id: int, body: int, link: int) -> tuple[Piece, ...]:
    """Return the pieces of an existing link; none where it cannot be touched, one UNKNOWN where they are not known."""
    return described_pieces(client_id, body, link)[0]


def described_pieces(client_id: int, body: int, link: int) -> tuple[tuple[Piece, ...], bool]:
    """Return the same, and whether they are visual pieces in place of collision pieces that fill the same space."""
    if is_maximal(client_id, body):
        return _maximal_pieces(client_id, body)
    drawn = visual_pieces(client_id, body, link)
    if must_not_be_asked(client_id, body, drawn):
        read = read_capsules(client_id, body, link, drawn)
        return (NOBODY_KNOWS if read is None else read), False
    with quiet_stdout():
        try:
            shapes = pybullet.getCollisionShapeData(body, link, physicsClientId=client_id)
        except pybullet.error:
            shapes = ()
    asked = tuple(
        Piece(kind, size, _name(file), position, quaternion) for _, _, kind, size, file, position, quaternion in shapes
    )
    return asked, False


def _maximal_pieces(client_id: int, body: int) -> tuple[tuple[Piece, ...], bool]:
    """Return the pieces of a body in maximal coordinates: from reduced ones, else visual ones of its box."""
    piece_kinds = {
        pybullet.GEOM_SPHERE,
        pybullet.GEOM_BOX,
        pybullet.GEOM_CYLINDER,
        pybullet.GEOM_MESH,
        pybullet.GEOM_PLANE,
        pybullet.GEOM_CAPSULE,
    }
    with reduced_body(client_id, body) as other:
        if other is not None:
            return collision_pieces(*other, -1), False
    drawn = tuple(piece for piece in visual_pieces(client_id, body, -1) if piece.kind in piece_kinds)
    if fills(client_id, body, -1, drawn):
        return drawn, True
    if len(drawn) == 1 and drawn[0].kind == pybullet.GEOM_MESH and len(hull_vertices(client_id, body, -1, 0)):
        return (drawn[0]._replace(file=""),), False  # getMeshData returns the hull that collides, whatever is drawn
    return NOBODY_KNOWS, False


def hull_vertices(client_id: int, body: int, link: int, index: int) -> Array:
    """Return the vertices (v, 3) of a convex collision piece in the body frame; none of a triangle mesh."""
    with quiet_stdout():
        try:
            _, vertices = pybullet.getMeshData(body, link, index, physicsClientId=client_id)
        except pybullet.error:
            vertices = ()
    return np.array(vertices, float).reshape(-1, 3)


def visual_pieces(client_id: int, body: int, link: int) -> tuple[Piece, ...]:
    """Return the visual shapes of an existing link in the body frame.

    PyBullet places them in the link frame; the body frame is the inertial frame within it.
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
