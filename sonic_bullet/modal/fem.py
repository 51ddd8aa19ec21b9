"""Linear elasticity on tetrahedra: element matrices by scikit-fem.

    K_ij = ∫ Bᵢᵀ C Bⱼ dV,   M_ij = ∫ ρ Nᵢ Nⱼ dV · 1₃          [Hughes, The Finite Element Method (1987), ch. 3.10, 7.2]

N are the field's shape functions (lagrange.py), mapped by the solid's quadratic elements (curved bodies keep their
volume), C any symmetric positive (6, 6) tensor in Voigt order xx yy zz yz xz xy. With G = ∂ξ/∂x the integrand is

    K_ij^ab = Σ_kl (Σ_de G_kd C_adbe G_le det J) ∂_k N_i ∂_l N_j

The bracket is one number per element where its edges are straight, so that all blocks are one dense product. They are
summed per pair of nodes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet.modal import lagrange
from sonic_bullet.modal.meshing.solid import TET_EDGE, Solid, corner_volume_m3
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

ELEMENTS_AT_ONCE = 1000  # elements at a time: keeps their (k, k) blocks out of memory
VOIGT = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])


def rule(order: int) -> tuple[Array, Array]:
    """Return points (q, 3) and weights (q,) of a rule exact to ``order`` on the reference tetrahedron."""
    from skfem import ElementTetP1
    from skfem.quadrature import get_quadrature

    point, weight = get_quadrature(ElementTetP1().refdom, order)
    return point.T, weight


def geometry(solid: Solid, tet: Array, point: Array) -> tuple[Array, Array]:
    """Compute det J (t, q) and ∂ξ/∂x (t, q, 3, 3) at reference points (q, 3)."""
    jacobian = np.einsum("tid,ikq->tqdk", solid.node_m[tet], lagrange.gradients(2, point), optimize=True)
    determinant = np.linalg.det(jacobian)
    if not (determinant > 0).all():
        raise MeshError("an element is turned inside out", "repair the mesh, or give a simpler one")
    return determinant, np.linalg.inv(jacobian)


def _mark_curved(solid: Solid) -> Array:
    """Return which elements (t,) have a curved edge."""
    straight = 1e-12  # of the body: a middle no farther off its chord lies on it
    chord = solid.node_m[solid.tet[:, TET_EDGE]].mean(axis=2)
    off = np.abs(solid.node_m[solid.tet[:, 4:]] - chord).max(axis=(1, 2))
    return np.asarray(off > straight * np.abs(solid.node_m).max())


def assemble(
    solid: Solid, stiffness_pa: Array, density_kg_m3: float, field: lagrange.Field | None = None
) -> tuple[Any, Any]:
    """Assemble stiffness and mass matrix of a field, by default the quadratic one.

    Both are (3n, 3n) scipy CSC, the unknowns of a node side by side. Raises MeshError where an element is inverted.
    """
    from scipy.sparse import bsr_array, csc_array, csr_array

    field = field or lagrange.field(solid, 2)
    n, k = len(field.node_m), field.tet.shape[1]
    code = (field.tet[:, :, None].astype(np.int64) * n + field.tet[:, None, :]).reshape(-1, k * k)
    pair, slot = np.unique(code, return_inverse=True)
    slot = slot.reshape(-1, k * k)
    stiff, mass = np.zeros((9, len(pair))), np.zeros(len(pair))
    bent = _mark_curved(solid)
    for which, curved in ((np.flatnonzero(~bent), False), (np.flatnonzero(bent), True)):
        for start in range(0, len(which), ELEMENTS_AT_ONCE):
            mine = which[start : start + ELEMENTS_AT_ONCE]
            blocks, masses = _blocks(solid, solid.tet[mine], stiffness_pa, field.degree, curved=curved)
            where = slot[mine].ravel()
            for component in range(9):
                stiff[component] += np.bincount(where, blocks[:, component].ravel(), len(pair))
            mass += np.bincount(where, masses.ravel(), len(pair))
    row = np.concatenate([[0], np.cumsum(np.bincount(pair // n, minlength=n))])
    k_matrix = bsr_array((stiff.T.reshape(-1, 3, 3), pair % n, row), shape=(3 * n, 3 * n))
    diagonal = np.zeros((len(pair), 3, 3))
    diagonal[:, range(3), range(3)] = (density_kg_m3 * mass)[:, None]
    m_csr = csr_array(bsr_array((diagonal, pair % n, row), shape=(3 * n, 3 * n)))
    m_csr.eliminate_zeros()
    k_csc = csc_array(k_matrix)
    return (k_csc + k_csc.T) / 2, csc_array(m_csr)


def _blocks(solid: Solid, tet: Array, stiffness_pa: Array, degree: int, *, curved: bool) -> tuple[Array, Array]:
    """Compute K_ij^ab (t, 9, k²) and ∫ NᵢNⱼ (t, k²) of elements tet (t, 10)."""
    tensor = stiffness_pa[VOIGT[:, :, None, None], VOIGT[None, None]]
    point, weight = rule(2 * degree if curved else 2 * degree - 2)
    gradient = lagrange.gradients(degree, point)
    product = np.einsum("ikq,jlq->klqij", gradient, gradient).reshape(9, len(weight), -1)
    if not curved:  # one point stands for all
        product, point, weight = np.einsum("pqi,q->pi", product, weight)[:, None], point[:1], np.ones(1)
    determinant, inverse = geometry(solid, tet, point)
    half = np.einsum("tqkd,adbe->tqkabe", inverse, tensor, optimize=True)
    bracket = np.einsum("tqkabe,tqle,tq->tabklq", half, inverse, determinant * weight, optimize=True)
    blocks = bracket.reshape(len(tet) * 9, -1) @ product.reshape(9 * len(weight), -1)
    point, weight = rule(2 * degree + 2 if curved else 2 * degree)
    shape = lagrange.values(degree, point)
    if curved:
        volume = geometry(solid, tet, point)[0] * weight
    else:
        volume = 6 * np.abs(corner_volume_m3(solid.node_m, tet))[:, None] * weight
    masses = volume @ np.einsum("iq,jq->qij", shape, shape).reshape(len(weight), -1)
    return blocks.reshape(len(tet), 9, -1), masses


def volume_m3(solid: Solid) -> float:
    """Compute the volume of a solid, curved elements integrated."""
    if solid.affine:
        return float(np.abs(corner_volume_m3(solid.node_m, solid.tet)).sum())
    point, weight = rule(6)
    return float(
        sum(
            (geometry(solid, solid.tet[s : s + ELEMENTS_AT_ONCE], point)[0] * weight).sum()
            for s in range(0, len(solid.tet), ELEMENTS_AT_ONCE)
        )
    )


def rigid_modes(node_m: Array) -> Array:
    """Return the six rigid motions (3n, 6), unnormalised: three translations, three rotations about the nodes' mean."""
    n = len(node_m)
    x = node_m - node_m.mean(axis=0)
    motion = np.zeros((n, 3, 6))
    motion[:, range(3), range(3)] = 1
    for k, axis in enumerate(np.eye(3)):
        motion[:, :, 3 + k] = np.cross(axis, x)
    return motion.reshape(3 * n, 6)


def mark_clamped(solid: Solid | lagrange.Field, clamp: Array) -> Array:
    """Return which nodes (n,) of a solid or a field are clamped; a sphere between nodes holds the nearest.

    Parameters
    ----------
    clamp : (k, 4) spheres (x, y, z, radius) in m

    Raises
    ------
    MeshError
        A sphere is farther from the body than an element.
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
