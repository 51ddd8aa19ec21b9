"""Mid-edge nodes moved onto the body's surface: straight chords of a curved wall cost per cents of its volume.

edge on a smooth part       -> nearest point that looks the same way
edge along a crease         -> nearest point of the surface's own creases
an element that this folds  -> its edges are straight again
what still lies off it      -> shifted onto it on the mean (mean_surface.py)
an element that this turns inside out -> its edges are straight again
"""

from __future__ import annotations

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal.meshing.mean_surface import on_the_mean
from sonic_bullet.modal.meshing.solid import TET_EDGE, Solid, corner_volume_m3, outer_faces
from sonic_bullet.records import Array

BODY_CENTRED = np.array([[a, b, c] for a in (0, 0.5, 1) for b in (0, 0.5, 1) for c in (0, 0.5, 1) if a + b + c <= 1])
"""Where an element's Jacobian is checked: corners and middles of its edges."""


def fit_to_surface(solid: Solid, vertex_m: Array, face: Array) -> Solid:
    """Move the mid-edge nodes of a straight solid onto the surface vertex_m (v, 3), face (f, 3) that it fills."""
    farthest = 0.25  # of an edge's length: a chord of a right angle deviates by 0.21
    edge, middle, normal, crease = _surface_edges(solid)
    ends = solid.node_m[edge]
    length, chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), ends.mean(axis=1)
    found, weight, _ = geometry.closest_point(vertex_m, face, chord, normal)
    target = np.einsum("kc,kcx->kx", weight, vertex_m[face[found]])
    line = creases(vertex_m, face)
    if crease.any() and len(line):
        along = nearest_on_lines(vertex_m[line], chord[crease])
        close = np.linalg.norm(along - chord[crease], axis=1) < farthest * length[crease]
        target[crease] = np.where(close[:, None], along, target[crease])
    moved = np.linalg.norm(target - chord, axis=1)
    near = (moved < farthest * length) & (moved > 1e-9 * length)
    node = solid.node_m.copy()
    node[middle[near]] = target[near]
    fitted = unfold_elements(Solid(node, solid.tet, not near.any(), solid.note))
    return unfold_elements(on_the_mean(fitted, vertex_m, face), least_det=0.0)


def _surface_edges(solid: Solid) -> tuple[Array, Array, Array, Array]:
    """Return a solid's surface edges (e, 2), their middle nodes (e,), mean outward normals (e, 3), and the creases."""
    outer = outer_faces(solid)
    normal = geometry.outward_normals(solid.node_m, outer[:, :3])
    middle, at, count = np.unique(outer[:, 3:].ravel(), return_inverse=True, return_counts=True)
    owner = np.repeat(np.arange(len(outer)), 3)
    total = np.stack([np.bincount(at, normal[owner, x], len(middle)) for x in range(3)], axis=1)
    # |n₁ + n₂| = 2 cos(angle/2); where pieces touch more than two faces meet: a crease, too
    crease = (np.linalg.norm(total, axis=1) < 2 * np.cos(CREASE_RAD / 2)) | (count != 2)
    ends = np.stack([outer[:, [0, 1, 2]], outer[:, [1, 2, 0]]], axis=-1).reshape(-1, 2)
    edge = np.empty((len(middle), 2), np.int64)
    edge[at] = ends
    return edge, middle, total, crease


def creases(vertex_m: Array, face: Array) -> Array:
    """Return the edges (e, 2) of a surface across which it turns by more than `CREASE_RAD`."""
    normal = geometry.outward_normals(vertex_m, face)
    edge = np.sort(np.stack([face, np.roll(face, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    line, at, count = np.unique(edge, axis=0, return_inverse=True, return_counts=True)
    owner = np.repeat(np.arange(len(face)), 3)
    total = np.stack([np.bincount(at.ravel(), normal[owner, x], len(line)) for x in range(3)], axis=1)
    return np.asarray(line[(np.linalg.norm(total, axis=1) < 2 * np.cos(CREASE_RAD / 2)) & (count == 2)])


def nearest_on_lines(line_m: Array, point_m: Array) -> Array:
    """Find the points (k, 3) nearest to point_m (k, 3) on straight lines line_m (e, 2 ends, 3)."""
    start, along = line_m[:, 0], line_m[:, 1] - line_m[:, 0]
    square = np.maximum((along**2).sum(axis=1), 1e-300)
    found = np.empty_like(point_m)
    for k, point in enumerate(point_m):
        part = np.clip(np.einsum("ex,ex->e", point - start, along) / square, 0, 1)
        on = start + part[:, None] * along
        found[k] = on[np.argmin(((on - point) ** 2).sum(axis=1))]
    return found


def unfold_elements(solid: Solid, least_det: float = 0.3) -> Solid:
    """Return the solid with straight edges where an element would fold.

    least_det: of the straight element's determinant; below it an element counts as folded.
    """
    from skfem import ElementTetP2

    element = ElementTetP2()
    gradient = np.array([element.lbasis(BODY_CENTRED.T, i)[1] for i in range(10)])
    node = solid.node_m.copy()
    straight = 6 * corner_volume_m3(node, solid.tet)
    while True:  # each round straightens one element at least
        determinant = np.linalg.det(np.einsum("tid,ikq->tqdk", node[solid.tet], gradient))
        folded = solid.tet[(determinant < least_det * straight[:, None]).any(axis=1)]
        if not len(folded):
            return Solid(node, solid.tet, solid.affine, solid.note)
        node[folded[:, 4:]] = node[folded[:, TET_EDGE]].mean(axis=2)
