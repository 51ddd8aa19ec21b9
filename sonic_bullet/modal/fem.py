"""Linear elasticity on quadratic tetrahedra: the one place that knows scikit-fem.

    K_ij = ∫ Bᵢᵀ C Bⱼ dV,   M_ij = ∫ ρ Nᵢ Nⱼ dV · 1₃          [Hughes, The Finite Element Method (1987), ch. 3.10, 7.2]

N are scikit-fem's `ElementTetP2` shape functions at its Gauss points, mapped isoparametrically (curved bodies keep
their volume), B the engineering strains in Voigt order xx yy zz yz xz xy, C any symmetric positive (6, 6) tensor.
Blocks are gathered per pair of nodes, so that assembly is a few dense products and one sort.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.modal.meshing.solid import Solid, corner_volume_m3
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

CHUNK = 2000  # elements at a time: keeps the (t, 30, 30) blocks of a large body out of memory


def _element(order: int) -> tuple[Array, Array, Array]:
    """Shape functions (10, q), their reference gradients (10, 3, q) and the weights (q,) of a rule exact to
    ``order``.
    """
    from skfem import ElementTetP2
    from skfem.quadrature import get_quadrature

    element = ElementTetP2()
    point, weight = get_quadrature(element.refdom, order)
    values = [element.lbasis(point, i) for i in range(10)]
    return np.array([v[0] for v in values]), np.array([v[1] for v in values]), weight


def _geometry(solid: Solid, tet: Array, gradient: Array, weight: Array) -> tuple[Array, Array]:
    """Volume per Gauss point (t, q) and physical gradients (t, q, 10, 3)."""
    jacobian = np.einsum("tid,ikq->tqdk", solid.node_m[tet], gradient)  # dx_d / dξ_k
    determinant = np.linalg.det(jacobian)
    if not (determinant > 0).all():
        raise MeshError("an element is turned inside out", "repair the mesh, or give a simpler one")
    physical = np.einsum("ikq,tqkd->tqid", gradient, np.linalg.inv(jacobian))
    return determinant * weight, physical


def _strain(gradient: Array) -> Array:
    """B (t, q, 6, 30) from gradients (t, q, 10, 3): engineering strains in Voigt order."""
    t, q = gradient.shape[:2]
    strain = np.zeros((t, q, 6, 10, 3))
    for row, axis in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
        strain[:, :, row, :, axis[0]] += gradient[..., axis[1]]
        if axis[0] != axis[1]:
            strain[:, :, row, :, axis[1]] += gradient[..., axis[0]]
    return strain.reshape(t, q, 6, 30)


def assemble(solid: Solid, stiffness_pa: Array, density_kg_m3: float) -> tuple[Any, Any]:
    """Stiffness and mass matrix, both (3n, 3n) scipy CSC with the dofs of a node side by side.

    Raises MeshError where an element is inverted.
    """
    from scipy.sparse import bsr_array, csc_array, csr_array

    n, t = len(solid.node_m), len(solid.tet)
    code = (solid.tet[:, :, None].astype(np.int64) * n + solid.tet[:, None, :]).ravel()
    pair, slot = np.unique(code, return_inverse=True)
    slot = slot.reshape(t, 100)
    _, gradient, weight = _element(2 if solid.affine else 4)
    shape, mass_gradient, mass_weight = _element(4 if solid.affine else 6)
    stiff = np.zeros((9, len(pair)))
    mass = np.zeros(len(pair))
    for start in range(0, t, CHUNK):
        tet, where = solid.tet[start : start + CHUNK], slot[start : start + CHUNK].ravel()
        volume, physical = _geometry(solid, tet, gradient, weight)
        strain = _strain(physical)
        block = np.zeros((len(tet), 30, 30))
        for q in range(len(weight)):
            b = strain[:, q]
            block += np.matmul(b.transpose(0, 2, 1), np.matmul(stiffness_pa * volume[:, q, None, None], b))
        parts = block.reshape(len(tet), 10, 3, 10, 3).transpose(2, 4, 0, 1, 3).reshape(9, -1)
        for k in range(9):
            stiff[k] += np.bincount(where, parts[k], len(pair))
        if solid.affine:
            volume = np.abs(corner_volume_m3(solid.node_m, tet))[:, None] * 6 * mass_weight
        else:
            volume, _ = _geometry(solid, tet, mass_gradient, mass_weight)
        mass += np.bincount(where, np.einsum("tq,iq,jq->tij", volume, shape, shape, optimize=True).ravel(), len(pair))
    row = np.concatenate([[0], np.cumsum(np.bincount(pair // n, minlength=n))])
    k_matrix = bsr_array((stiff.T.reshape(-1, 3, 3), pair % n, row), shape=(3 * n, 3 * n))
    blocks = np.zeros((len(pair), 3, 3))
    blocks[:, range(3), range(3)] = (density_kg_m3 * mass)[:, None]
    m_matrix = bsr_array((blocks, pair % n, row), shape=(3 * n, 3 * n))
    m_csr = csr_array(m_matrix)
    m_csr.eliminate_zeros()
    k_csc = csc_array(k_matrix)
    return (k_csc + k_csc.T) / 2, csc_array(m_csr)


def volume_m3(solid: Solid) -> float:
    """Volume of a solid, curved elements integrated."""
    if solid.affine:
        return float(np.abs(corner_volume_m3(solid.node_m, solid.tet)).sum())
    _, gradient, weight = _element(6)
    return float(
        sum(
            _geometry(solid, solid.tet[s : s + CHUNK], gradient, weight)[0].sum()
            for s in range(0, len(solid.tet), CHUNK)
        )
    )


def rigid_modes(node_m: Array) -> Array:
    """The six motions of a rigid body (3n, 6), unnormalised: three shifts, three turns about the nodes' mean."""
    n = len(node_m)
    x = node_m - node_m.mean(axis=0)
    motion = np.zeros((n, 3, 6))
    motion[:, range(3), range(3)] = 1
    for k, axis in enumerate(np.eye(3)):
        motion[:, :, 3 + k] = np.cross(axis, x)
    return motion.reshape(3 * n, 6)


def clamped(solid: Solid, clamp: Array) -> Array:
    """Which nodes (n,) the spheres clamp (k, 4) of (x, y, z, radius) in m hold; a sphere between nodes holds the
    nearest.

    Raises MeshError where a sphere is farther from the body than an element.
    """
    fixed = np.zeros(len(solid.node_m), bool)
    for x, y, z, radius in clamp:
        distance = np.linalg.norm(solid.node_m - (x, y, z), axis=1)
        inside = distance <= radius
        if not inside.any():
            edge = float(np.linalg.norm(solid.node_m[solid.tet[:, 0]] - solid.node_m[solid.tet[:, 1]], axis=1).max())
            if distance.min() > radius + edge:
                raise MeshError(
                    f"clamp at ({x:g}, {y:g}, {z:g}) m, radius {radius:g} m, does not touch the body",
                    "give its place in the body frame",
                )
            inside = distance == distance.min()
        fixed |= inside
    return fixed
