"""Wedges: polynomials of one degree along the sheet and another through it, their sides curved.

    N_ij(ξ, η, ζ) = T_i(ξ, η) L_j(ζ),   T on a triangle, L on −1 ≤ ζ ≤ 1
    x(ξ, η, ζ) = Σ_k S_k(ξ, η) [(1+ζ)/2 outer_k + (1−ζ)/2 inner_k],   S: degree 2       [Zienkiewicz & Taylor 2000,
                                                                                          ch. 8.8, 8.12]

Slopes are as smooth as deflections, so that thin sheets bend: tetrahedra of degree 3 have one degree less. Of degree 2
through it a sheet gets thinner where it is stretched: no plane stress is assumed, any tensor will do. Degree 3 holds
the parabola of shear stress as well. Where that is missing errors have a part of about (thickness/wavelength)².
Nodes of a triangle: corners 0 1 2, then p − 1 on each edge 01 12 20, then its inside.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet.modal.fem import ELEMENTS_AT_ONCE, VOIGT
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

TRIANGLE_EDGE = np.array([[0, 1], [1, 2], [2, 0]])


class Layer(NamedTuple):
    """One layer of curved wedges: outer_m, inner_m (n, 3) of the same nodes, triangle (t, 6): corners, then middles."""

    outer_m: Array
    inner_m: Array
    triangle: Array


class WedgeField(NamedTuple):
    """Nodes of a field.

    Attributes
    ----------
    along, through : its degrees along the sheet and through it
    node_m : (n, 3)
    wedge : (t, k) indices into node_m, of each node of a triangle those through the sheet
    """

    along: int
    through: int
    node_m: Array
    wedge: Array


def _powers(degree: int) -> list[tuple[int, int]]:
    return [(a, b) for a in range(degree + 1) for b in range(degree + 1 - a)]


@lru_cache(maxsize=4)
def triangle_nodes(degree: int) -> Array:
    """Return the reference coordinates (k, 2) of a triangle's nodes."""
    corner = np.array([[0.0, 0], [1, 0], [0, 1]])
    part = np.arange(1, degree) / degree
    edges = [corner[i] + p * (corner[j] - corner[i]) for i, j in TRIANGLE_EDGE for p in part]
    inside = [np.array([a, b]) / degree for a in range(1, degree) for b in range(1, degree - a)]
    return np.array([*corner, *edges, *inside])


@lru_cache(maxsize=4)
def _coefficients(degree: int) -> Array:
    point = triangle_nodes(degree)
    return np.asarray(
        np.linalg.inv(np.stack([point[:, 0] ** a * point[:, 1] ** b for a, b in _powers(degree)], axis=1))
    )


def triangle_values(degree: int, point: Array) -> Array:
    """Compute T_i and its derivatives (3, k, q) at reference points (q, 2)."""
    x, y = point.T
    monomials = [
        [x**a * y**b, a * x ** max(a - 1, 0) * y**b, b * x**a * y ** max(b - 1, 0)] for a, b in _powers(degree)
    ]
    return np.asarray(np.einsum("mdq,mk->dkq", np.array(monomials), _coefficients(degree)))


@lru_cache(maxsize=4)
def line_nodes(degree: int) -> Array:
    """Return the heights (k,) of a line's nodes: its ends 1 and −1, then those between."""
    return np.array([1.0, -1.0, *(np.linspace(1, -1, degree + 1)[1:-1])])


def _line_values(degree: int, z: Array) -> Array:
    """Compute L_j and its derivative (2, k, q) at heights z (q,)."""
    power = np.arange(degree + 1)
    coefficient = np.linalg.inv(line_nodes(degree)[:, None] ** power)
    monomials = [z[:, None] ** power, power * z[:, None] ** np.maximum(power - 1, 0)]
    return np.asarray(np.einsum("dqm,mk->dkq", np.array(monomials), coefficient))


def _wedge_values(along: int, through: int, point: Array, z: Array) -> tuple[Array, Array]:
    """Compute N (k, q) and its gradients (k, 3, q) at all points (p, 2) and heights z (h,): q = p h."""
    flat, line = triangle_values(along, point), _line_values(through, z)

    def product(a: Array, b: Array) -> Array:
        return np.asarray(np.einsum("iq,jr->ijqr", a, b).reshape(len(a) * len(b), -1))

    gradient = [product(flat[1], line[0]), product(flat[2], line[0]), product(flat[0], line[1])]
    return product(flat[0], line[0]), np.stack(gradient, axis=1)


def _rule(along: int, through: int) -> tuple[Array, Array, Array]:
    """Return points (p, 2), heights (h,) and weights (p h,) for products of fields of these degrees."""
    from skfem import ElementTriP1
    from skfem.quadrature import get_quadrature

    point, weight = get_quadrature(ElementTriP1().refdom, 2 * along)
    height, depth = np.polynomial.legendre.leggauss(through + 1)
    return point.T, height, np.outer(weight, depth).ravel()


def _ends(layer: Layer) -> Array:
    """Return the nodes (t, 12, 3) of each wedge's sides, in the order of `_wedge_values`."""
    return np.stack([layer.outer_m[layer.triangle], layer.inner_m[layer.triangle]], axis=2).reshape(
        len(layer.triangle), 12, 3
    )


def determinants(layer: Layer) -> Array:
    """Compute det J (t, q) at the nodes of both sides."""
    _, gradient = _wedge_values(2, 1, triangle_nodes(2), np.array([-1.0, 1.0]))
    return np.asarray(np.linalg.det(np.einsum("tgx,gdq->tqxd", _ends(layer), gradient)))


def volume(layer: Layer) -> float:
    """Compute the volume of all wedges."""
    point, height, weight = _rule(2, 2)
    _, gradient = _wedge_values(2, 1, point, height)
    return float((np.linalg.det(np.einsum("tgx,gdq->tqxd", _ends(layer), gradient)) @ weight).sum())


def field(layer: Layer, along: int, through: int) -> WedgeField:
    """Build the nodes of a field of these degrees on a layer."""
    corner = layer.triangle[:, :3]
    used, corner = np.unique(corner, return_inverse=True)
    corner = corner.reshape(-1, 3)
    ends = corner[:, TRIANGLE_EDGE]
    edge, at = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    first = len(used) + (along - 1) * at.reshape(-1, 3, 1)
    k = np.arange(along - 1)
    on_edges = first + np.where((ends[:, :, 0] > ends[:, :, 1])[:, :, None], along - 2 - k, k)
    inner = (along - 1) * (along - 2) // 2
    inside = len(used) + (along - 1) * len(edge) + np.arange(len(corner))[:, None] * inner + np.arange(inner)
    flat = np.concatenate([corner, on_edges.reshape(len(corner), -1), inside], axis=1)
    deep = through + 1
    wedge = (flat[:, :, None] * deep + np.arange(deep)).reshape(len(corner), -1)
    shape, _ = _wedge_values(2, 1, triangle_nodes(along), line_nodes(through))
    node_m = np.empty((wedge.max() + 1, 3))
    node_m[wedge.ravel()] = np.einsum("gk,tgx->tkx", shape, _ends(layer)).reshape(-1, 3)
    return WedgeField(along, through, node_m, wedge)


def at_nodes(layer: Layer, of: WedgeField) -> Any:
    """Build the sparse map (2n, nodes) from the field's values at its nodes to the layer's outer, then inner nodes."""
    from scipy.sparse import csr_array

    count = len(layer.outer_m)
    place = np.zeros(count, np.int64)
    flat = layer.triangle.ravel()
    place[flat[::-1]] = np.arange(len(flat))[::-1]
    triangle, local = np.divmod(place, 6)
    shape, _ = _wedge_values(of.along, of.through, triangle_nodes(2), np.array([1.0, -1.0]))
    shape = shape.reshape(len(shape), 6, 2)
    weight = np.concatenate([shape[:, local, 0].T, shape[:, local, 1].T])
    column = np.tile(of.wedge[triangle], (2, 1))
    row = np.repeat(np.arange(2 * count), column.shape[1])
    return csr_array((weight.ravel(), (row, column.ravel())), shape=(2 * count, len(of.node_m)))


def assemble(layer: Layer, of: WedgeField, stiffness_pa: Array, density_kg_m3: float) -> tuple[Any, Any]:
    """Assemble stiffness and mass matrix of a field: scipy CSC (3n, 3n), the unknowns of a node side by side.

    Raises MeshError where a wedge is inverted.
    """
    from scipy.sparse import bsr_array, csc_array, csr_array

    n, k = len(of.node_m), of.wedge.shape[1]
    code = (of.wedge[:, :, None].astype(np.int64) * n + of.wedge[:, None, :]).reshape(-1, k * k)
    pair, slot = np.unique(code, return_inverse=True)
    slot = slot.reshape(-1, k * k)
    tensor = stiffness_pa[VOIGT[:, :, None, None], VOIGT[None, None]]
    point, height, weight = _rule(of.along, of.through)
    shape, gradient = _wedge_values(of.along, of.through, point, height)
    _, sides = _wedge_values(2, 1, point, height)
    product = np.einsum("ikq,jlq->klqij", gradient, gradient).reshape(9 * len(weight), -1)
    masses = np.einsum("iq,jq->qij", shape, shape).reshape(len(weight), -1)
    stiff, mass, ends = np.zeros((9, len(pair))), np.zeros(len(pair)), _ends(layer)
    for start in range(0, len(of.wedge), ELEMENTS_AT_ONCE // 5):
        mine = slice(start, start + ELEMENTS_AT_ONCE // 5)
        jacobian = np.einsum("tgx,gdq->tqxd", ends[mine], sides)
        determinant = np.linalg.det(jacobian)
        if not (determinant > 0).all():
            raise MeshError("a wedge is turned inside out", "repair the mesh, or give a simpler one")
        inverse, here = np.linalg.inv(jacobian), determinant * weight
        half = np.einsum("tqkd,adbe->tqkabe", inverse, tensor, optimize=True)
        bracket = np.einsum("tqkabe,tqle,tq->tabklq", half, inverse, here, optimize=True)
        blocks = (bracket.reshape(9 * len(here), -1) @ product).reshape(len(here), 9, -1)
        where = slot[mine].ravel()
        for component in range(9):
            stiff[component] += np.bincount(where, blocks[:, component].ravel(), len(pair))
        mass += np.bincount(where, (here @ masses).ravel(), len(pair))
    row = np.concatenate([[0], np.cumsum(np.bincount(pair // n, minlength=n))])
    k_matrix = csc_array(bsr_array((stiff.T.reshape(-1, 3, 3), pair % n, row), shape=(3 * n, 3 * n)))
    diagonal = np.zeros((len(pair), 3, 3))
    diagonal[:, range(3), range(3)] = (density_kg_m3 * mass)[:, None]
    m_csr = csr_array(bsr_array((diagonal, pair % n, row), shape=(3 * n, 3 * n)))
    m_csr.eliminate_zeros()
    return (k_matrix + k_matrix.T) / 2, csc_array(m_csr)
