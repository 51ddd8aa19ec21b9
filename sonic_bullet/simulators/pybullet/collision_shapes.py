"""Geometry of a link in its body frame (centre of mass, axes of getBasePositionAndOrientation).

    getCollisionShapeData[5, 6]
        placement of a shape, body frame (measured: also with a rotated inertial frame)
    getMeshData                   vertices in the body frame, of a hull only; "?" and nothing for a triangle mesh

Bullet collides with the convex hull of a mesh; the sound needs the surface itself. So a mesh is taken from the file
named by the shape; or from the visual mesh where it fills the same space (createMultiBody forgets the collision file's
name); or from the hull's vertices. URDF cylinders collide as hulls of 32-gons without a name: they are recognised and
returned as cylinders.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet

from sonic_bullet.geometry import volume_m3
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError
from sonic_bullet.simulators.frames import link_words
from sonic_bullet.simulators.pybullet.colliding.filled_space import link_pose
from sonic_bullet.simulators.pybullet.colliding.given_bodies import (
    SAME_SIZE_M,
    SAME_SIZE_SHARE,
    given_triangles,
    is_maximal,
    reduced_body,
)
from sonic_bullet.simulators.pybullet.colliding.pieces import (
    UNKNOWN,
    Piece,
    collision_pieces,
    hull_vertices,
    turn_matrix,
    visual_pieces,
)
from sonic_bullet.simulators.pybullet.urdf_meshes import MeshSurface, hull, join_surfaces, read_surfaces


def shapes_of(client_id: int, body: int, link: int) -> tuple[Shape, ...]:
    """Return all pieces of the collision geometry of a link that exists.

    Raises
    ------
    MeshError
        There are none, or PyBullet does not describe them.
    """
    if is_maximal(client_id, body):
        with reduced_body(client_id, body) as other:
            if other is not None:
                return shapes_of(*other, -1)
    pieces = collision_pieces(client_id, body, link)
    if not pieces:
        raise MeshError(
            f"body {body}{link_words(link)} has no collision shape, or one that PyBullet does not describe",
            "add another link, or pass mesh=",
        )
    if pieces[0].kind == UNKNOWN:
        raise MeshError(
            f"body {body}{link_words(link)} collides as something that PyBullet cannot be asked for, and what is drawn "
            "does not fill the same space",
            "attach to the BulletClient before it is loaded, load it without useMaximalCoordinates or fromto, "
            "or pass mesh=",
        )
    shapes: list[Shape] = []
    filed: set[Piece] = set()
    hulls: list[tuple[Piece, Array]] = []
    for i, piece in enumerate(pieces):
        if piece.kind != pybullet.GEOM_MESH:
            shapes.append(primitive(piece, f"body {body}{link_words(link)}"))
        elif _file(piece) is None:
            hulls.append((piece, hull_vertices(client_id, body, link, i)))
        elif piece not in filed:  # Bullet may list a file of several hulls once for each
            filed.add(piece)
            shapes.append(_from_file(client_id, body, link, i, piece))
    return (*shapes, *_shapes_without_file(client_id, body, link, hulls))


def _takes_its_box(client_id: int, body: int, vertex_m: Array) -> bool:
    """Tell whether vertices (v, 3) in the frame of a base have its bounding box."""
    position, turn = link_pose(client_id, body, -1)
    local = np.array([vertex_m.min(axis=0), vertex_m.max(axis=0)])
    half, middle = np.abs(turn) @ np.ptp(local, axis=0) / 2, turn @ local.mean(axis=0) + position
    box = np.array(pybullet.getAABB(body, -1, physicsClientId=client_id))
    tolerance = SAME_SIZE_M + SAME_SIZE_SHARE * float(np.ptp(box, axis=0).max())
    return bool(np.abs(np.array([middle - half, middle + half]) - box).max() < tolerance)


def _file(piece: Piece) -> Path | None:
    return Path(piece.file) if piece.file and Path(piece.file).is_file() else None


def primitive(piece: Piece, where: str) -> Shape:
    """Convert a sphere, box, capsule, cylinder or plane from getCollisionShapeData.

    Raises
    ------
    MeshError
        It is of another kind.
    """
    kind, size, _, position, quaternion = piece
    if kind == pybullet.GEOM_SPHERE:
        return Shape("sphere", np.array([size[0], 0, 0]), position, quaternion)
    if kind == pybullet.GEOM_BOX:
        return Shape("box", size, position, quaternion)
    if kind in (pybullet.GEOM_CAPSULE, pybullet.GEOM_CYLINDER):
        return Shape(
            "capsule" if kind == pybullet.GEOM_CAPSULE else "cylinder",
            np.array([size[1], size[0], 0]),
            position,
            quaternion,
        )
    if kind == pybullet.GEOM_PLANE:
        return Shape("plane", position_m=position, quaternion_xyzw=_up_to(np.array(size)))
    raise MeshError(f"{where} has a collision shape of unknown kind {kind}", "pass mesh=")


def _up_to(normal: Array) -> Array:
    """Compute the quaternion that rotates +z to a unit normal (3,)."""
    if normal[2] < -1 + 1e-12:
        return np.array([1.0, 0, 0, 0])
    q = np.array([-normal[1], normal[0], 0, 1 + normal[2]])
    return np.asarray(q / np.linalg.norm(q))


def outward(vertex_m: Array, face: Array) -> Shape:
    """Return a mesh in the body frame, its faces inverted where it encloses a negative volume."""
    return Shape("mesh", vertex_m=vertex_m, face=face if volume_m3(vertex_m, face) >= 0 else face[:, ::-1])


def _from_file(client_id: int, body: int, link: int, index: int, piece: Piece) -> Shape:
    path = _file(piece)
    assert path is not None
    try:
        vertex, face = join_surfaces(read_surfaces(path))
    except MeshError:
        vertices = hull_vertices(client_id, body, link, index)
        if not len(vertices):
            raise
        return outward(*hull(vertices))
    return outward((vertex * piece.size) @ turn_matrix(piece.quaternion).T + piece.position, face)


def _shapes_without_file(client_id: int, body: int, link: int, hulls: list[tuple[Piece, Array]]) -> tuple[Shape, ...]:
    """Return meshes whose file PyBullet forgot: cylinders by vertices, else the visual mesh of the extent, or hulls."""
    if not hulls:
        return ()
    cylinders = [_as_cylinder(piece, vertices) for piece, vertices in hulls]
    rest = [vertices for (_, vertices), cylinder in zip(hulls, cylinders, strict=True) if cylinder is None]
    found = tuple(cylinder for cylinder in cylinders if cylinder is not None)
    if not rest:
        return found
    given = given_triangles(client_id, body) if link < 0 and not found and len(rest) == 1 and not len(rest[0]) else None
    if given is not None and _takes_its_box(client_id, body, given[0]):
        return (outward(*given),)
    visual = visual_surface(client_id, body, link)
    known = np.concatenate(rest)
    if visual is not None and len(known) and _same_space(visual[0], known):
        return (*found, outward(*visual))
    if all(len(vertices) for vertices in rest):
        return (*found, *(outward(*hull(vertices)) for vertices in rest))
    if visual is not None:
        return (*found, outward(*visual))
    raise MeshError(
        f"body {body}{link_words(link)} is a triangle mesh that PyBullet does not give back",
        "load it from a file, or pass mesh=",
    )


def _same_space(one: Array, other: Array) -> bool:
    """Tell whether two point sets have the same bounding box within a tenth of its diagonal."""
    same_space = 0.1
    size = np.linalg.norm(np.ptp(other, axis=0))
    return bool(
        np.abs(one.min(0) - other.min(0)).max() < same_space * size
        and np.abs(one.max(0) - other.max(0)).max() < same_space * size
    )


def _as_cylinder(piece: Piece, vertices: Array) -> Shape | None:
    """Return the cylinder along z whose two rims the vertices are, or None."""
    if len(vertices) < 24 or len(vertices) % 2:
        return None
    local = (vertices - piece.position) @ turn_matrix(piece.quaternion)
    radius, half = np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])
    tolerance = 1e-3 * (radius.max() + half.max())
    if np.ptp(radius) > tolerance or np.ptp(half) > tolerance or not half.min() > tolerance:
        return None
    return Shape("cylinder", np.array([radius.max(), 2 * half.max(), 0]), piece.position, piece.quaternion)


def visual_surface(client_id: int, body: int, link: int) -> MeshSurface | None:
    """Join the link's visual mesh files in the body frame; None where there are none or they cannot be read."""
    surfaces: list[MeshSurface] = []
    for piece in visual_pieces(client_id, body, link):
        path = _file(piece)
        if piece.kind != pybullet.GEOM_MESH or path is None:
            return None
        try:
            vertex, face = join_surfaces(read_surfaces(path))
        except MeshError:
            return None
        surfaces.append(((vertex * piece.size) @ turn_matrix(piece.quaternion).T + piece.position, face))
    return join_surfaces(surfaces) if surfaces else None
