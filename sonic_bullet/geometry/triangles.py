"""Triangle surfaces: volume, inertia, normals, curvature (the nearest point is in nearest_point.py).

    V = ⅙ Σ a·(b×c),   ∫x xᵀ dV by signed tetrahedra about the origin             [Tonon 2004, eq. 9; Eberly 2002]
    second fundamental form of a face from its corner normals: II·e = Δn on each edge       [Rusinkiewicz 2004, eq. 3]

Everywhere vertex_m is (v, 3), face (f, 3) of indices, counter-clockwise seen from outside.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.geometry.components import label_components
from sonic_bullet.records import Array

LARGEST_M, HEAVIEST_STRUCK_KG = 10.0, 202e3
"""Of what is struck to sound: the largest bell ever cast, the Tsar Bell, is 6.6 m wide and weighs 202 t.

A mesh in millimetres is a thousand times its size, so that all above a centimetre exceeds the first, and a steel ball
of 4 mm the second.
"""
CREASE_RAD = np.deg2rad(30.0)


def area_vectors_m2(vertex_m: Array, face: Array) -> Array:
    """Compute normals (f, 3) as long as the faces' areas, outward where the faces are."""
    a, b, c = (vertex_m[face[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a) / 2)


def face_areas_m2(vertex_m: Array, face: Array) -> Array:
    """Compute the area (f,) of each face."""
    return np.asarray(np.linalg.norm(area_vectors_m2(vertex_m, face), axis=1))


def outward_normals(vertex_m: Array, face: Array) -> Array:
    """Compute unit normals (f, 3), outward where the faces are; zero for a face without area."""
    vector = area_vectors_m2(vertex_m, face)
    length = np.linalg.norm(vector, axis=1)
    return np.asarray(vector / np.where(length > 0, length, 1)[:, None])


def volume_m3(vertex_m: Array, face: Array) -> float:
    """Compute the enclosed volume; negative where the faces look inward, meaningless where the surface is open."""
    if len(face) == 0:
        return 0.0
    centre = vertex_m[face].reshape(-1, 3).mean(axis=0)
    a, b, c = (vertex_m[face[:, k]] - centre for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def inertia(vertex_m: Array, face: Array, density_kg_m3: float) -> tuple[float, Array, Array]:
    """Compute mass in kg, centre of mass (3,) in m and inertia (3, 3) in kg·m² about it, of the enclosed solid."""
    origin = vertex_m[face].reshape(-1, 3).mean(axis=0)
    corner = vertex_m[face] - origin  # (f, 3 corners, 3)
    volume = np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) / 6
    total = volume.sum()
    centre = np.einsum("f,fkx->x", volume, corner) / 4 / total
    sums = corner.sum(axis=1)
    second = np.einsum("f,fkx,fky->xy", volume, corner, corner) / 20 + np.einsum("f,fx,fy->xy", volume, sums, sums) / 20
    second -= total * np.outer(centre, centre)
    mass = float(total * density_kg_m3)
    return mass, np.asarray(centre + origin), np.asarray(density_kg_m3 * (np.trace(second) * np.eye(3) - second))


def weld_vertices(vertex_m: Array, face: Array) -> tuple[Array, Array]:
    """Merge identical vertices and drop faces of repeated vertices: (v', 3), (f', 3)."""
    unique, inverse = np.unique(vertex_m + 0.0, axis=0, return_inverse=True)  # + 0.0: minus zero is zero
    face = inverse.ravel()[face]
    whole = (face[:, 0] != face[:, 1]) & (face[:, 1] != face[:, 2]) & (face[:, 2] != face[:, 0])
    return unique, face[whole]


def oversize(vertex_m: Array, mass_kg: float) -> str:
    """Describe a body that is larger than anything that is struck to sound; "" for all others.

    Most such bodies are meshes in millimetres, grounds or terrains: their modes are no mistake, but hardly what was
    meant.
    """
    long_m = float(np.ptp(vertex_m, axis=0).max()) if len(vertex_m) else 0.0
    if long_m <= LARGEST_M and mass_kg <= HEAVIEST_STRUCK_KG:
        return ""
    return f"is {long_m:.3g} m long and would weigh {mass_kg:.3g} kg, larger than anything that is struck to sound"


def _edges(face: Array) -> Array:
    """Return directed edges (3f, 2): edge k of face i (corner k to k+1) in row 3i + k."""
    return np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2).astype(np.int64)


def is_closed(face: Array) -> bool:
    """Test whether every edge is used as often one way as the other: no hole, neighbours agree on the outside.

    Merge vertices first (``weld_vertices``).
    """
    edge = _edges(face)
    n = int(face.max()) + 1 if len(face) else 1
    forward = np.sort(edge[:, 0] * n + edge[:, 1])
    backward = np.sort(edge[:, 1] * n + edge[:, 0])
    return bool(len(face) > 0 and np.array_equal(forward, backward))


def _smooth_neighbours(face: Array, normal: Array) -> tuple[Array, Array]:
    """Find pairs of directed edges (rows of `_edges`) that two faces share at less than the crease angle."""
    edge = _edges(face)
    n = int(face.max()) + 1
    key = edge.min(axis=1) * n + edge.max(axis=1)
    order = np.argsort(key, kind="stable")
    ranked = key[order]
    same = np.flatnonzero(ranked[1:] == ranked[:-1])
    one, two = order[same], order[same + 1]
    smooth = np.einsum("ij,ij->i", normal[one // 3], normal[two // 3]) > np.cos(CREASE_RAD)
    return one[smooth], two[smooth]


def corner_normals(vertex_m: Array, face: Array) -> Array:
    """Compute unit normals (f, 3, 3) at the corners of each face.

    They are averaged by angle over the faces that join there without a crease.
    """
    normal = outward_normals(vertex_m, face)
    edge = _edges(face)
    one, two = _smooth_neighbours(face, normal)
    # A directed edge 3i+k starts at corner 3i+k and ends at corner 3i+(k+1)%3; match the corners of both faces by
    # vertex.
    end = 3 * (np.arange(len(edge)) // 3) + (np.arange(len(edge)) + 1) % 3
    turned = edge[one, 0] == edge[two, 1]
    joins_a = np.concatenate([one, end[one]])
    joins_b = np.concatenate([np.where(turned, end[two], two), np.where(turned, two, end[two])])
    label = label_components(len(edge), joins_a, joins_b)
    corner = vertex_m[face]
    to_next, to_last = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    lengths = np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    cosine = np.einsum("fkx,fkx->fk", to_next, to_last) / np.where(lengths > 0, lengths, 1)
    weight = np.arccos(np.clip(cosine, -1, 1)).ravel()
    mean = np.stack([np.bincount(label, weight * np.repeat(normal[:, x], 3)) for x in range(3)], axis=1)[label]
    length = np.linalg.norm(mean, axis=1)
    return np.asarray((mean / np.where(length > 0, length, 1)[:, None]).reshape(-1, 3, 3))


def face_curvature(vertex_m: Array, face: Array) -> Array:
    """Compute the mean of the principal curvatures (f,) in 1/m: 1/r on a ball, 0 on a flat side, negative in a bowl.

    Faces that meet at more than 30° meet in a crease, which does not count.
    """
    if len(face) == 0:
        return np.zeros(0)
    vertex_m, whole = np.asarray(vertex_m, float), np.asarray(face)
    unique, inverse = np.unique(vertex_m + 0.0, axis=0, return_inverse=True)
    face = inverse.ravel()[whole]
    normal, at_corner = outward_normals(unique, face), corner_normals(unique, face)
    corner = unique[face]
    edge, change = np.roll(corner, -1, axis=1) - corner, np.roll(at_corner, -1, axis=1) - at_corner
    first = edge[:, 0] / np.maximum(np.linalg.norm(edge[:, 0], axis=1), 1e-300)[:, None]
    second = np.cross(normal, first)
    u, v = np.einsum("fkx,fx->fk", edge, first), np.einsum("fkx,fx->fk", edge, second)
    nu, nv = np.einsum("fkx,fx->fk", change, first), np.einsum("fkx,fx->fk", change, second)
    zero = np.zeros_like(u)
    # (f, 6, 3): e f g of II
    system = np.concatenate([np.stack([u, v, zero], axis=-1), np.stack([zero, u, v], axis=-1)], axis=1)
    right = np.concatenate([nu, nv], axis=1)
    good = face_areas_m2(unique, face) > 1e-6 * (edge**2).sum(axis=(1, 2))
    curvature = np.zeros(len(face))
    if good.any():
        inverse_normal = np.linalg.inv(np.einsum("fij,fik->fjk", system[good], system[good]))
        form = np.einsum("fjk,fik,fi->fj", inverse_normal, system[good], right[good])
        curvature[good] = (form[:, 0] + form[:, 2]) / 2
    scale = np.abs(unique).max() or 1.0
    curvature[np.abs(curvature) * scale < 1e-9] = 0.0  # rounding on flat sides
    return curvature
