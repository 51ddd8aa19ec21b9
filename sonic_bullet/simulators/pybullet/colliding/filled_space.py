"""Check by bounding boxes whether pieces are the collision shape of a link.

box of a shape in a rotated frame: |R| h around R c + x           (Bullet's rule for all but spheres: h for any R)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pybullet

from sonic_bullet.records import Array
from sonic_bullet.records.errors import SonicBulletError
from sonic_bullet.simulators.pybullet.colliding.given_bodies import SAME_SIZE_M, SAME_SIZE_SHARE
from sonic_bullet.simulators.pybullet.urdf_meshes import join_surfaces, read_surfaces

if TYPE_CHECKING:
    from sonic_bullet.simulators.pybullet.colliding.pieces import Piece


def link_pose(client_id: int, body: int, link: int) -> tuple[Array, Array]:
    """Return position (3,) and rotation (3, 3) of a link's body frame."""
    if link < 0:
        position, quaternion = pybullet.getBasePositionAndOrientation(body, physicsClientId=client_id)
    else:
        state = pybullet.getLinkState(body, link, computeForwardKinematics=1, physicsClientId=client_id)
        position, quaternion = state[:2]
    return np.array(position), _turn(quaternion)


def _turn(quaternion: object) -> Array:
    return np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


def half_size(piece: Piece) -> tuple[Array, Array] | None:
    """Return half the sides (3,) and the centre (3,) of a piece's box in its own frame; None where it has none."""
    size = piece.size
    if piece.kind == pybullet.GEOM_SPHERE:
        return np.full(3, size[0]), np.zeros(3)
    if piece.kind == pybullet.GEOM_BOX:
        return np.array(size) / 2, np.zeros(3)
    if piece.kind in (pybullet.GEOM_CAPSULE, pybullet.GEOM_CYLINDER):
        ends = size[1] if piece.kind == pybullet.GEOM_CAPSULE else 0.0
        return np.array([size[1], size[1], size[0] / 2 + ends]), np.zeros(3)
    if piece.kind == pybullet.GEOM_MESH and piece.file:
        try:
            vertex = join_surfaces(read_surfaces(Path(piece.file)))[0] * piece.size
        except (SonicBulletError, OSError):
            return None
        low, high = vertex.min(axis=0), vertex.max(axis=0)
        return (high - low) / 2, (high + low) / 2
    return None


def fills(
    client_id: int,
    body: int,
    link: int,
    pieces: Sequence[Piece],
    grown_m: Sequence[float] | None = None,
    fine: float = 1.0,
) -> bool:
    """Tell whether pieces together have the bounding box of the link.

    Parameters
    ----------
    grown_m
        By how much the box of a capsule made of two spheres is larger on each side; 0 for all other pieces.
    fine
        Fraction of the usual tolerance.
    """
    boxes = [half_size(piece) for piece in pieces]
    known = [box for box in boxes if box is not None]
    if not pieces or len(known) < len(pieces):
        return False
    low, high = (np.array(part) for part in pybullet.getAABB(body, link, physicsClientId=client_id))
    position, turn = link_pose(client_id, body, link)
    corners = []
    for piece, (half, centre), grown in zip(pieces, known, grown_m or [0.0] * len(pieces), strict=True):
        own = _turn(piece.quaternion)
        if grown:
            side = np.abs(own[:, 2]) * piece.size[0] / 2 + piece.size[1] + grown
        else:
            side = half if piece.kind == pybullet.GEOM_SPHERE else np.abs(own) @ half
        middle = own @ centre + np.array(piece.position)
        corners.append((middle - side, middle + side))
    least, most = np.min([a for a, _ in corners], axis=0), np.max([b for _, b in corners], axis=0)
    sides = [np.abs(turn) @ (most - least) / 2]
    if len(pieces) == 1 and not any(grown_m or ()):  # a single piece is not boxed twice
        sphere = pieces[0].kind == pybullet.GEOM_SPHERE
        sides.append(known[0][0] if sphere else np.abs(turn @ _turn(pieces[0].quaternion)) @ known[0][0])
    middle = turn @ (most + least) / 2 + position
    tolerance = fine * (SAME_SIZE_M + SAME_SIZE_SHARE * float((high - low).max()))
    return bool(
        np.abs((low + high) / 2 - middle).max() < tolerance
        and min(np.abs((high - low) / 2 - side).max() for side in sides) < tolerance
    )
