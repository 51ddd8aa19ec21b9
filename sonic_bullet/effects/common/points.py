"""Points of a body's surface: the nearest, some that lie apart, those alike under a symmetry, their normals."""

from __future__ import annotations

import numpy as np

from sonic_bullet.geometry import area_vectors_m2
from sonic_bullet.records import Array, ModalModel


def nearest(x: ModalModel, place: tuple[float, float, float]) -> int:
    """Find the surface vertex nearest to a place (3,)."""
    body: Array = np.unique(x.face)
    return int(body[np.argmin(((x.vertex_m[body] - np.array(place)) ** 2).sum(axis=1))])


def vertex_normals(model: ModalModel) -> Array:
    """Compute outward unit normals (v, 3), means of the faces around a vertex weighted with their areas."""
    v, f = model.vertex_m, model.face
    vector, normal = area_vectors_m2(v, f), np.zeros_like(v)
    for i in range(3):
        np.add.at(normal, f[:, i], vector)
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300))
