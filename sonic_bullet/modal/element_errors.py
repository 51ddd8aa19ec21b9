"""Error of each mode's frequency: by the stress that its elements should have, and by other elements.

    σ* at a node: mean of its elements' stresses, without traction where the surface is free
    λ_h − λ = ‖u_h − u‖²_E − λ ‖u_h − u‖²_M ≈ ∫ (σ* − σ_h) : C⁻¹ : (σ* − σ_h) dV
        [Strang & Fix 1973, ch. 6.3; Zienkiewicz & Zhu 1987, eq. 9, 14; traction as Wiberg, Abdulwahab & Ziukas 1994]

Where an element spans a wall, its stress is smooth and yet wrong: there the traction on both sides of the wall tells
it. Along creases that look inward stress is singular and no traction is taken away.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.geometry import CREASE_RAD
from sonic_bullet.modal import fem, lagrange
from sonic_bullet.modal.meshing.solid import Solid, corner_volume_m3, outer_faces
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

SLOPES = np.array(
    [
        [[-3, -3], [-1, 0], [0, -1], [4, 0], [0, 0], [0, 4]],
        [[1, 1], [3, 0], [0, -1], [-4, -4], [0, 4], [0, 0]],
        [[1, 1], [-1, 0], [0, 3], [0, 0], [4, 0], [-4, -4]],
        [[-1, -1], [1, 0], [0, -1], [0, -2], [0, 2], [0, 2]],
        [[1, 1], [1, 0], [0, 1], [-2, -2], [2, 2], [-2, -2]],
        [[-1, -1], [-1, 0], [0, 1], [2, 0], [2, 0], [-2, 0]],
    ],
    float,
)
"""Slopes (node, function, direction) of a quadratic triangle's shape functions at its own nodes."""


def recovered_errors(
    solid: Solid, field: lagrange.Field, tensor: Array, held: Array, found: tuple[Array, Array]
) -> Array:
    """Estimate by what fraction of itself each frequency is too high.

    Parameters
    ----------
    solid, field, tensor
        Elements, polynomials on them, stiffness (6, 6).
    held
        Which of the solid's nodes (n,) are clamped: there is traction.
    found
        λ (m,) and displacements (3k, m) at the field's nodes, VᵀMV = 1.

    Returns
    -------
    Array, shape (m,)
        (λ_h − λ)/2λ; NaN where a curved element is folded at one of its nodes, so that it has no stress there.
    """
    at_once = 8  # modes at a time: keeps their stresses out of memory
    value, vector = found
    volume = np.abs(corner_volume_m3(solid.node_m, solid.tet))
    mean = _mean(solid, volume)
    node, without = _free_of_traction(solid, held)
    parts = np.linalg.cholesky(np.linalg.inv(tensor))
    point, weight = fem.rule(4)
    shape = lagrange.values(2, point)
    inner = np.linalg.cholesky(6 * (shape * weight) @ shape.T)
    energy = np.empty(len(value))
    for start in range(0, len(value), at_once):
        mine = slice(start, min(start + at_once, len(value)))
        try:
            stress = _stress(solid, field, tensor, vector[:, mine])
        except MeshError:
            return np.full(len(value), np.nan)
        smooth = (mean @ stress.reshape(len(volume) * 10, -1)).reshape(len(solid.node_m), 6, -1)
        smooth[node] = without @ smooth[node]
        off = (smooth[solid.tet] - stress).reshape(len(volume), 10, -1)
        off = parts.T @ (inner.T @ off).reshape(len(volume), 10, 6, -1)
        energy[mine] = np.einsum("tivm,tivm,t->m", off, off, volume, optimize=True)
    return np.asarray(energy / (2 * value))


def log_changes(other: Array, value: Array) -> Array:
    """Compute half of ln of λ ``other`` (k,) over ``value`` (m,), both ascending; those that other lacks get the last.

    Modes closer to one another than their change may have changed places: they get its mean.
    """
    return with_neighbours(np.log(extend_values(other[: len(value)] / value[: len(other)], len(value))) / 2, value)


def with_neighbours(change: Array, value: Array) -> Array:
    """Return changes (m,) of ln f of modes with λ ``value``; modes closer than theirs to one another get the mean."""
    distant = np.flatnonzero(np.diff(np.log(value)) / 2 > np.abs(change[:-1])) + 1
    return np.concatenate(
        [np.zeros(0), *(np.full(len(few), few.mean()) for few in np.split(change, distant) if len(few))]
    )


def extend_values(values: Array, count: int) -> Array:
    """Cut or extend values (m,) to count, the last repeated."""
    return np.asarray(values[np.minimum(np.arange(count), len(values) - 1)]) if len(values) else np.zeros(count)


def _stress(solid: Solid, field: lagrange.Field, tensor: Array, vector: Array) -> Array:
    """Compute the stress (t, 10, 6, b) of displacements (3k, b) at each element's own ten nodes."""
    modes = vector.shape[1]
    displacement = vector.reshape(-1, 3 * modes)
    local = lagrange.local_nodes(2)
    slope = lagrange.gradients(field.degree, local)
    law = tensor[:, fem.VOIGT.ravel()]
    found = np.empty((len(solid.tet), 10, 6, modes))
    for start in range(0, len(solid.tet), fem.ELEMENTS_AT_ONCE):
        mine = slice(start, start + fem.ELEMENTS_AT_ONCE)
        _, inverse = fem.geometry(solid, solid.tet[mine], local)
        gradient = np.einsum("kdq,tqde->tqek", slope, inverse, optimize=True)
        turned = gradient.reshape(len(gradient), -1, gradient.shape[-1]) @ displacement[field.tet[mine]]
        found[mine] = law @ turned.reshape(len(gradient), 10, 9, modes)
    return found


def _mean(solid: Solid, volume: Array) -> Any:
    """Build the sparse map (n, 10t) from elements' values at their nodes to the nodes' means, by volume."""
    from scipy.sparse import csr_array

    flat = solid.tet.ravel()
    weight = np.repeat(volume, 10)
    weight = weight / np.bincount(flat, weight, len(solid.node_m))[flat]
    return csr_array((weight, (flat, np.arange(len(flat)))), shape=(len(solid.node_m), len(flat)))


def _free_of_traction(solid: Solid, held: Array) -> tuple[Array, Array]:
    """Return the nodes (b,) of free surface, and the maps (b, 6, 6) that leave their stress without traction.

    At a node where faces meet it is without traction on each of them; faces of one smooth wall count as one.
    """
    same = 0.3  # of the largest singular value: normals that differ by less are those of one wall
    outer = outer_faces(solid)
    tangent = np.einsum("nsd,fsx->fndx", SLOPES, solid.node_m[outer])
    normal = np.cross(tangent[:, :, 0], tangent[:, :, 1])
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    loaded = held.copy()
    loaded[_inward(solid, outer)] = True
    node, normal = outer.ravel(), normal.reshape(-1, 3)
    node, normal = node[~loaded[node]], normal[~loaded[node]]
    order = np.argsort(node, kind="stable")
    one, first, place, count = np.unique(node[order], return_index=True, return_inverse=True, return_counts=True)
    if not len(one):
        return one, np.zeros((0, 6, 6))
    law = np.zeros((len(one), 3 * int(count.max()), 6))
    row = 3 * (np.arange(len(order)) - first[place])
    for a in range(3):
        for b in range(3):
            law[place, row + a, fem.VOIGT[a, b]] += normal[order, b]
    twice = np.sqrt([1, 1, 1, 2, 2, 2])  # shear stands twice in the tensor: no axes are preferred
    law /= twice
    value, vector = np.linalg.eigh(law.transpose(0, 2, 1) @ law)
    kept = value <= same**2 * value[:, -1:]
    return one, (vector * kept[:, None, :]) @ vector.transpose(0, 2, 1) * twice / twice[:, None]


def _inward(solid: Solid, outer: Array) -> Array:
    """Return the nodes (k,) of creases of the faces (f, 6) that look inward, and of edges of more than two faces."""
    start, end, across = outer[:, [0, 1, 2]].ravel(), outer[:, [1, 2, 0]].ravel(), outer[:, [2, 0, 1]].ravel()
    corner = solid.node_m[outer[:, :3]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    middle = outer[:, 3:].ravel()
    order = np.argsort(middle, kind="stable")
    edge, first, count = np.unique(middle[order], return_index=True, return_counts=True)
    one, other = order[first[count == 2]], order[first[count == 2] + 1]
    cos = np.einsum("ex,ex->e", normal[one // 3], normal[other // 3])
    above = np.einsum("ex,ex->e", solid.node_m[across[other]] - solid.node_m[start[other]], normal[one // 3])
    sharp = one[(cos < np.cos(CREASE_RAD)) & (above > 0)]
    lone = np.isin(middle, edge[count != 2])
    return np.concatenate([start[sharp], end[sharp], middle[sharp], start[lone], end[lone], middle[lone]])
