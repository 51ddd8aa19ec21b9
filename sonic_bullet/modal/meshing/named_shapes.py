"""Boxes, balls, cylinders and capsules: meshed by rule, or as surfaces beside others in the body frame."""

from __future__ import annotations

import numpy as np

from sonic_bullet.modal.meshing import structured
from sonic_bullet.modal.meshing.sizes import dof_budget
from sonic_bullet.modal.meshing.solid import Solid, surface
from sonic_bullet.modal.meshing.surfaces import BODY_SIZE_M
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import MeshError


def rotation(quaternion_xyzw: Array) -> Array:
    """Compute the matrix (3, 3) of a quaternion [Shoemake 1985, eq. 10]."""
    length = float(np.linalg.norm(quaternion_xyzw))
    if not length > 0:
        raise MeshError("a shape's quaternion is zero", "give a rotation, (0, 0, 0, 1) for none")
    x, y, z, w = quaternion_xyzw / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def place_points(shape: Shape, point: Array) -> Array:
    """Transform points (k, 3) of a shape's own frame to the body frame."""
    return np.asarray(point @ rotation(shape.quaternion_xyzw).T + shape.position_m)


def box_cells(size_m: Array, edge_m: float | None) -> tuple[int, int, int]:
    """Count the cells along x, y, z: of edge_m, or of the finest even grid within the budget of unknowns."""
    if edge_m is None:
        budget = dof_budget(1 / float((1 / size_m).sum()), float(np.linalg.norm(size_m)))
        tries = size_m.max() / np.arange(4, 400)
        fits = 3 * np.prod(2 * np.maximum(1, np.round(size_m / tries[:, None])) + 1, axis=1) <= budget
        edge_m = float(tries[np.flatnonzero(fits)[-1]]) if fits.any() else float(tries[0])
        cells = np.maximum(1, np.round(size_m / edge_m)).astype(int)
        long = int(np.argmax(size_m))
        across = [k for k in range(3) if k != long]
        # a bar: its twist warps the section, which takes four cells either way
        if size_m[across].max() < size_m[long] / 4:
            cells[across] = np.maximum(cells[across], 4)
            cells[long] = max(8, int((budget / (3 * np.prod(2 * cells[across] + 1)) - 1) / 2))
        return int(cells[0]), int(cells[1]), int(cells[2])
    nx, ny, nz = (max(1, round(float(s) / edge_m)) for s in size_m)
    return nx, ny, nz


def box(size_m: Array, edge_m: float | None) -> Solid:
    """Mesh a box about the origin. Raises MeshError where it has no volume."""
    if not (size_m > 0).all():
        raise MeshError(f"box of size {size_m} m has no volume", "give edge lengths above zero")
    return structured.box(size_m, box_cells(size_m, edge_m))


def mesh_named_shape(shape: Shape, edge_m: float | None) -> Solid:
    """Mesh a named shape about its own origin."""
    if shape.kind == "box":
        return box(shape.size_m, edge_m)
    radius, length = float(shape.size_m[0]), float(shape.size_m[1])
    if not radius > 0 or (shape.kind == "cylinder" and not length > 0):
        raise MeshError(
            f"{shape.kind} of radius {radius} m and length {length} m has no volume", "give sizes above zero"
        )
    if shape.kind == "sphere" or (shape.kind == "capsule" and length <= 0):
        return structured.sphere(radius, 5 if edge_m is None else max(2, round(radius / edge_m)))
    if edge_m is None:
        # A disc of n rings has 12 n² quadratic nodes on 2 l + 1 heights (the caps of a capsule count as one more
        # radius).
        whole = length + (radius if shape.kind == "capsule" else 0)
        thickness = 2 / (2 / radius + 2 / whole)
        budget = dof_budget(thickness, float(np.hypot(2 * radius, whole)))
        tries = radius / np.arange(2, 60)
        dof = 36 * np.round(radius / tries) ** 2 * (2 * np.maximum(1, np.round(whole / tries)) + 1)
        edge_m = float(tries[max(0, int(np.searchsorted(dof, budget)) - 1)])
    n, layers = max(2, round(radius / edge_m)), max(1, round(length / edge_m))
    return (structured.capsule if shape.kind == "capsule" else structured.cylinder)(radius, length, n, layers)


def alone(shapes: tuple[Shape, ...], thickness_m: float | None) -> Shape | None:
    """Return the one solid box, ball, cylinder or capsule that the shapes are, else None.

    Raises MeshError where its size is absurd.
    """
    if len(shapes) > 1 or shapes[0].kind == "mesh" or thickness_m is not None:
        return None
    one = shapes[0]
    if not BODY_SIZE_M[0] < one.size_m.max() < BODY_SIZE_M[1]:
        raise MeshError(
            f"{one.kind} is {one.size_m.max():.3g} m across", "check its unit and scale: metres are expected"
        )
    return one


def soup(shapes: tuple[Shape, ...]) -> tuple[Array, Array]:
    """Collect all surfaces in the body frame: vertices (v, 3), faces (f, 3)."""
    vertices, faces, offset = [], [], 0
    for shape in shapes:
        if shape.kind == "mesh":
            vertex, face = shape.vertex_m, shape.face
        else:
            solid = mesh_named_shape(shape, float(shape.size_m.max() if shape.kind == "box" else shape.size_m[0] / 4))
            skin = surface(solid)
            vertex, face = solid.node_m[skin.node], skin.face
        vertices.append(place_points(shape, vertex))
        faces.append(np.asarray(face, np.int64) + offset)
        offset += len(vertex)
    return np.concatenate(vertices), np.concatenate(faces)
