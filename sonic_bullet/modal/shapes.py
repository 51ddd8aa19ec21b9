"""Shapes -> one solid of quadratic tetrahedra in the body frame.

one box, sphere, cylinder or capsule -> laid out by rule (structured.py)
a mesh, or several shapes            -> their surfaces together -> fTetWild -> tetrahedra
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sonic_bullet.errors import MeshError
from sonic_bullet.modal import structured
from sonic_bullet.modal.solid import Solid, largest_component, quadratic, surface
from sonic_bullet.records import Array, Shape

DOF_BUDGET = 24_000
TETS_BUDGET = DOF_BUDGET / 5.2  # measured: degrees of freedom per tetrahedron of a chunky body


def rotation(quaternion_xyzw: Array) -> Array:
    """Matrix (3, 3) of a quaternion [Shoemake 1985, eq. 10]."""
    x, y, z, w = quaternion_xyzw / np.linalg.norm(quaternion_xyzw)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _placed(shape: Shape, point: Array) -> Array:
    return np.asarray(point @ rotation(shape.quaternion_xyzw).T + shape.position_m)


def box_cells(size_m: Array, edge_m: float | None) -> tuple[int, int, int]:
    """Cells along x, y, z: of edge_m, or the finest even grid of at most `DOF_BUDGET` unknowns."""
    if edge_m is None:
        tries = size_m.max() / np.arange(4, 400)
        counts = np.maximum(1, np.round(size_m / tries[:, None]))
        fits = 3 * np.prod(2 * counts + 1, axis=1) <= DOF_BUDGET
        edge_m = float(tries[np.flatnonzero(fits)[-1]]) if fits.any() else float(tries[0])
    nx, ny, nz = (max(1, round(float(s) / edge_m)) for s in size_m)
    return nx, ny, nz


def _named(shape: Shape, edge_m: float | None) -> Solid:
    """Structured solid of a named shape about its own origin."""
    if shape.kind == "box":
        if not (shape.size_m > 0).all():
            raise MeshError(f"box of size {shape.size_m} m has no volume", "give edge lengths above zero")
        return structured.box(shape.size_m, box_cells(shape.size_m, edge_m))
    radius, length = float(shape.size_m[0]), float(shape.size_m[1])
    if not radius > 0 or (shape.kind == "cylinder" and not length > 0):
        raise MeshError(f"{shape.kind} of radius {radius} m and length {length} m has no volume", "give sizes above zero")
    if shape.kind == "sphere":
        n = 5 if edge_m is None else max(2, round(radius / edge_m))
        return structured.sphere(radius, n)
    if edge_m is None:
        # dof ≈ 3·(rings of a disc ≈ 12 n² P2 nodes)·(2 layers + 1): choose n with layers of the same height as a ring.
        edge_m = max((12 * 3 * 2 * radius**2 * max(length, radius) / DOF_BUDGET) ** (1 / 3), radius / 8)
    n, layers = max(2, round(radius / edge_m)), max(1, round(length / edge_m))
    if shape.kind == "capsule":
        return structured.capsule(radius, length, n, layers) if length > 0 else structured.sphere(radius, n)
    return structured.cylinder(radius, length, n, layers)


def _soup(shapes: tuple[Shape, ...]) -> tuple[Array, Array]:
    """All surfaces together in the body frame: vertices (v, 3), faces (f, 3)."""
    vertices, faces, offset = [], [], 0
    for shape in shapes:
        if shape.kind == "mesh":
            vertex, face = shape.vertex_m, shape.face
        else:
            solid = _named(shape, float(shape.size_m[shape.size_m > 0].min()) / 3)
            skin = surface(solid)
            vertex, face = solid.node_m[skin.node], skin.face
        vertices.append(_placed(shape, vertex))
        faces.append(face + offset)
        offset += len(vertex)
    return np.concatenate(vertices), np.concatenate(faces)


def _filled(vertex_m: Array, face: Array, edge_m: float | None) -> Solid:
    from sonic_bullet.modal.tetrahedra import tetrahedra

    a, b, c = (vertex_m[face[:, k]] for k in range(3))
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6))
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    thickness = 2 * volume / area
    if edge_m is None:
        edge_m = max(0.75 * thickness, (volume / (0.112 * TETS_BUDGET)) ** (1 / 3))
    node, tet = tetrahedra(vertex_m, face, edge_m, 0.04 * thickness)
    tet, pieces = largest_component(node, tet)
    note = f"fTetWild, edge {edge_m:.3g} m, envelope {0.04 * thickness:.2g} m"
    if pieces > 1:
        note += f"; largest of {pieces} separate pieces kept"
    return quadratic(node, tet, note=note)


def solid(shapes: tuple[Shape, ...], edge_m: float | None, thickness_m: float | None, say: Callable[[str], None]) -> Solid:
    """One solid, the union of ``shapes``, in the body frame. Raises MeshError."""
    if len(shapes) == 1 and shapes[0].kind != "mesh":
        made = _named(shapes[0], edge_m)
        return Solid(_placed(shapes[0], made.node_m), made.tet, made.affine, made.note)
    vertex, face = _soup(shapes)
    say(f"filling {len(face)} triangles with tetrahedra")
    return _filled(vertex, face, edge_m)
