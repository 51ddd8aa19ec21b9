"""A filled body shifted until its surface lies on the true one on the mean: faces that must stay flat cut nothing off.

An element with two faces on a bent surface cannot follow it, for it would fold (on_surface.py). Flat faces between
corners on the surface are chords. A stem of radius R that has n = 8 of them holds A = n/(2π) sin(2π/n) = 0.900 of the
circle's area, and A (2 + cos(2π/n))/3 = 0.812 of its polar moment [Young & Budynas, Roark's Formulas, 7th ed., table
A.1, regular polygons]. Shifted outward by the mean gap the octagon has a radius of 1.054 R, 0.9994 of the area, and
1.001 of the polar moment.

    gᶠ = mean over a face of (nearest point of the surface − point) · n
    dⁱ: Σ over a corner's faces of area (nᶠ·dⁱ − gᶠ)² least; middles of edges go with their ends; twice
"""

from __future__ import annotations

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal.meshing.solid import TET_EDGE, Solid, corner_volume_m3, outer_faces
from sonic_bullet.records import Array


def on_the_mean(solid: Solid, vertex_m: Array, face: Array) -> Solid:
    """Shift the corners of a solid so that its faces lie on the surface vertex_m (v, 3), face (f, 3) on the mean."""
    rounds, least_volume = 2, 0.5  # least_volume: of an element, over what it was
    corners = solid.tet[:, :4].max() + 1
    before = corner_volume_m3(solid.node_m, solid.tet)
    for _ in range(rounds):
        shift = _corner_shift(solid, corners, vertex_m, face)
        while True:
            node = solid.node_m.copy()
            node[:corners] += shift
            node[solid.tet[:, 4:]] = solid.node_m[solid.tet[:, 4:]] + shift[solid.tet[:, TET_EDGE]].mean(axis=2)
            flat = solid.tet[corner_volume_m3(node, solid.tet) < least_volume * before][:, :4]
            if not shift[flat].any():
                break
            shift[flat] = 0
        solid = Solid(node, solid.tet, solid.affine, solid.note)
    return solid


def _corner_shift(solid: Solid, corners: int, vertex_m: Array, face: Array) -> Array:
    """Compute how far each corner (corners, 3) moves, in m: none inside the body."""
    least = 0.25  # of a corner's area that faces one way: it does not slide along faces that are nearly parallel
    outer = outer_faces(solid)
    normal = geometry.outward_normals(solid.node_m, outer[:, :3])
    area = geometry.face_areas_m2(solid.node_m, outer[:, :3])
    weighted = area[:, None] * normal
    matrix, right, total = np.zeros((corners, 3, 3)), np.zeros((corners, 3)), np.zeros(corners)
    gap_m = _mean_gap_m(solid, outer, normal, vertex_m, face)
    for k in range(3):
        np.add.at(matrix, outer[:, k], weighted[:, :, None] * normal[:, None, :])
        np.add.at(right, outer[:, k], gap_m[:, None] * weighted)
        np.add.at(total, outer[:, k], area)
    on = total > 0
    shift = np.zeros((corners, 3))
    value, axis = np.linalg.eigh(matrix[on])
    along = np.einsum("cxa,cx->ca", axis, right[on])
    along = np.where(value > least * total[on][:, None], along / np.maximum(value, 1e-300), 0.0)
    shift[on] = np.einsum("cxa,ca->cx", axis, along)
    return shift


def _mean_gap_m(solid: Solid, outer: Array, normal: Array, vertex_m: Array, face: Array) -> Array:
    """Compute how far the surface lies outside each curved face (k,) of outer (k, 6), on the mean."""
    from skfem import ElementTriP2
    from skfem.quadrature import get_quadrature

    on_it = 1e-9  # of a face's width: rounding
    element = ElementTriP2()
    at, weight = get_quadrature(element.refdom, 4)
    shape = np.array([element.lbasis(at, i)[0] for i in range(6)])
    point = np.einsum("ip,fix->fpx", shape, solid.node_m[outer])
    found, part, _ = geometry.closest_point(
        vertex_m, face, point.reshape(-1, 3), np.repeat(normal, len(weight), axis=0)
    )
    true = np.einsum("kc,kcx->kx", part, vertex_m[face[found]]).reshape(point.shape)
    gap_m = np.einsum("fpx,fx,p->f", true - point, normal, weight / weight.sum())
    return np.where(np.abs(gap_m) > on_it * np.sqrt(geometry.face_areas_m2(solid.node_m, outer[:, :3])), gap_m, 0.0)
