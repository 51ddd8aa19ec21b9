"""Fields on a body's tetrahedra: Lagrange polynomials of degree 1 to 3, and what elements need of them.

    N_i = Σ_m c_im ξ^a η^b ζ^c, a + b + c <= p, N_i(ξ_j) = δ_ij        [Zienkiewicz & Taylor 2000, ch. 8.10]

Nodes of an element: corners 0 1 2 3, then p − 1 on each edge 01 12 02 03 13 23, for p = 3 one in each face 012 013 023
123. For p = 2 they are the solid's own. A thin wall bends as polynomials of one degree less than p: λ's error falls as
(h/wavelength)² for p = 2, as its fourth power for p = 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from sonic_bullet.modal.meshing.solid import TET_EDGE, Solid
from sonic_bullet.records import Array

FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Nodes of a field of a given degree.

    Attributes
    ----------
    node_m : (n, 3)
    tet : (t, 4, 10 or 20) indices into node_m, the solid's elements in its order
    """

    degree: int
    node_m: Array
    tet: Array


def field(solid: Solid, degree: int) -> Field:
    """Build the nodes of a field of degree 1, 2 or 3 on a solid; those of a curved edge or face lie on it."""
    if degree == 2:
        return Field(2, solid.node_m, solid.tet)
    used, corner = np.unique(solid.tet[:, :4], return_inverse=True)
    n, corner = len(used), corner.reshape(-1, 4)
    if degree == 1:
        return Field(1, solid.node_m[used], corner)
    ends = corner[:, TET_EDGE]
    edge, at = np.unique(np.sort(ends, axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    first = n + 2 * at.reshape(-1, 6)
    turned = (ends[:, :, 0] > ends[:, :, 1]).astype(np.int64)
    pairs = np.stack([first + turned, first + 1 - turned], axis=2).reshape(-1, 12)
    face, of = np.unique(np.sort(corner[:, FACES], axis=2).reshape(-1, 3), axis=0, return_inverse=True)
    tet = np.concatenate([corner, pairs, n + 2 * len(edge) + of.reshape(-1, 4)], axis=1)
    node_m = np.empty((n + 2 * len(edge) + len(face), 3))
    node_m[tet.ravel()] = np.einsum("ik,tix->tkx", values(2, local_nodes(3)), solid.node_m[solid.tet]).reshape(-1, 3)
    return Field(3, node_m, tet)


@lru_cache(maxsize=4)
def local_nodes(degree: int) -> Array:
    """Return the reference coordinates (k, 3) of an element's nodes."""
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    part = np.arange(1, degree) / degree
    edges = [corner[i] + p * (corner[j] - corner[i]) for i, j in TET_EDGE for p in part]
    return np.array([*corner, *edges, *(corner[f].mean(axis=0) for f in FACES if degree == 3)])


@lru_cache(maxsize=4)
def _powers(degree: int) -> tuple[tuple[int, int, int], ...]:
    whole = range(degree + 1)
    return tuple((a, b, c) for a in whole for b in whole for c in whole if a + b + c <= degree)


@lru_cache(maxsize=4)
def _coefficients(degree: int) -> Array:
    return np.asarray(np.linalg.inv(_monomials(degree, local_nodes(degree))))


def _monomials(degree: int, point: Array) -> Array:
    return np.stack([np.prod(point ** np.array(power), axis=1) for power in _powers(degree)], axis=1)


def values(degree: int, point: Array) -> Array:
    """Compute N_i (k, q) at reference points (q, 3)."""
    return np.asarray((_monomials(degree, point) @ _coefficients(degree)).T)


def gradients(degree: int, point: Array) -> Array:
    """Compute ∂N_i/∂ξ_d (k, 3, q) at reference points (q, 3)."""
    found = np.empty((len(_powers(degree)), 3, len(point)))
    for d in range(3):
        terms = []
        for power in _powers(degree):
            less = np.array(power)
            less[d] = max(0, less[d] - 1)
            terms.append(power[d] * np.prod(point**less, axis=1))
        found[:, d] = (np.stack(terms, axis=1) @ _coefficients(degree)).T
    return found


def at_nodes(of: Field, solid: Solid, node: Array) -> Any:
    """Build the sparse map (v, n) from a field's values at its own n nodes to those at the solid's nodes (v,)."""
    from scipy.sparse import csr_array

    place = np.full(len(solid.node_m), -1)
    flat = solid.tet.ravel()
    place[flat[::-1]] = np.arange(len(flat))[::-1]
    element, local = np.divmod(place[node], 10)
    weight = values(of.degree, local_nodes(2))[:, local].T
    row = np.repeat(np.arange(len(node)), weight.shape[1])
    return csr_array((weight.ravel(), (row, of.tet[element].ravel())), shape=(len(node), len(of.node_m)))
