"""Geoms of MuJoCo as shapes, in the frame of their body's inertia.

geom type, size, pos, quat -> Shape; ellipsoids as meshes; meshes with their own triangles, not their hulls
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from sonic_bullet.geometry import volume_m3
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.bodies import ShapeKind
from sonic_bullet.records.errors import MeshError

SIZED: dict[Any, tuple[ShapeKind, Callable[[float, float, float], tuple[float, float, float]]]] = {
    mujoco.mjtGeom.mjGEOM_PLANE: ("plane", lambda x, y, z: (0, 0, 0)),
    mujoco.mjtGeom.mjGEOM_SPHERE: ("sphere", lambda x, y, z: (x, 0, 0)),
    mujoco.mjtGeom.mjGEOM_CAPSULE: ("capsule", lambda x, y, z: (x, 2 * y, 0)),
    mujoco.mjtGeom.mjGEOM_CYLINDER: ("cylinder", lambda x, y, z: (x, 2 * y, 0)),
    mujoco.mjtGeom.mjGEOM_BOX: ("box", lambda x, y, z: (2 * x, 2 * y, 2 * z)),
}
"""Kind of shape, and its size_m of a geom's size: MuJoCo's are half lengths."""


def shape_of_geom(model: Any, geom: int, place_m: Array, turn_wxyz: Array, *, placed: bool = True) -> Shape:
    """Return the shape of a geom in a frame given in its body's.

    Parameters
    ----------
    place_m, turn_wxyz : Array, shapes (3,), (4,)
        The frame: a body's ipos and iquat.
    placed
        Whether to place it; else it lies in its own frame.

    Raises
    ------
    MeshError
        It is a height field, a signed distance field or a flex, which has no surface here.
    """
    where: dict[str, Array] = {}
    if placed:
        position, turn, back = np.zeros(3), np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(back, np.asarray(turn_wxyz, float))
        mujoco.mju_rotVecQuat(position, np.asarray(model.geom_pos[geom] - place_m, float), back)
        mujoco.mju_mulQuat(turn, back, model.geom_quat[geom])
        where = {"position_m": position, "quaternion_xyzw": turn[[1, 2, 3, 0]]}
    x, y, z = (float(one) for one in model.geom_size[geom])
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind in SIZED:
        word, size = SIZED[kind]
        return Shape(word, np.array(size(x, y, z)), **where)
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        vertex, face = _ellipsoid(np.array([x, y, z]))
        return Shape("mesh", vertex_m=vertex, face=face, **where)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        number = int(model.geom_dataid[geom])
        first, many = int(model.mesh_vertadr[number]), int(model.mesh_vertnum[number])
        face_at, faces = int(model.mesh_faceadr[number]), int(model.mesh_facenum[number])
        vertex = np.array(model.mesh_vert[first : first + many], float)
        return Shape(
            "mesh", vertex_m=vertex, face=np.array(model.mesh_face[face_at : face_at + faces], np.int32), **where
        )
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_GEOM, geom) or f"geom {geom}"
    raise MeshError(
        f"{name} is a height field or distance field, which has no shape here", "give mesh=, or leave it silent"
    )


def _ellipsoid(radius_m: Array) -> tuple[Array, Array]:
    """Return vertices and triangles of an ellipsoid about the origin."""
    ellipsoid_rings = 24  # Rings of triangles of an ellipsoid, of twice as many each
    from trimesh.creation import uv_sphere

    made = uv_sphere(radius=1, count=[ellipsoid_rings, 2 * ellipsoid_rings])
    vertex, face = np.array(made.vertices), made.faces.astype(np.int32)
    fuller = np.cbrt(4 / 3 * np.pi / volume_m3(vertex, face))  # of the same volume
    return fuller * vertex * radius_m, face
