"""What elements lose of a bent surface: by how much frequencies change where the body's own takes their faces' place.

    surface moved out by g:  δλ = ∫ g (ε:C:ε − λ |u|²) dA for uᵀMu = 1      [Hadamard 1908; Rayleigh's quotient, varied]

Faces lie on the surface on the mean (meshing/mean_surface.py), so that most of what is left is of second order: a
polygon twists more easily than its circle. With λ(g) = λ + L g + Q g²/2 of the faces, the integral, which takes the
modes at g, is −L g − Q g² where −L g − Q g²/2 is lost: once that where L g is more, twice where nothing else is left.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.modal import fem, lagrange
from sonic_bullet.modal.meshing.solid import TET_FACE, Solid, outer_places
from sonic_bullet.records import Array


def gaps_error(
    solid: Solid,
    field: lagrange.Field,
    tensor: Array,
    found: tuple[Array, Array],
    skin: tuple[Array, Array],
) -> float:
    """Estimate by what fraction of itself a frequency changes at most where the surface takes the faces' place.

    Parameters
    ----------
    solid, field, tensor
        Elements, polynomials on them, stiffness (6, 6).
    found
        λ (m,) and displacements (3k, m) at the field's nodes, VᵀMV = 1.
    skin
        Corners (v, 3) and triangles (f, 3) of the surface that the solid fills.
    """
    from skfem import ElementTriP1
    from skfem.quadrature import get_quadrature

    at_once = 8  # modes at a time: keeps their strains out of memory
    on_it = 1e-9  # of the body: rounding
    value, vector = found
    at, weight = get_quadrature(ElementTriP1().refdom, 4)
    corner = lagrange.local_nodes(2)
    law = tensor[np.ix_(fem.VOIGT.ravel(), fem.VOIGT.ravel())]
    change = np.zeros(len(value))
    owner, local = outer_places(solid)
    for k, (a, b, c, *_) in enumerate(TET_FACE):
        point = corner[a] + np.outer(at[0], corner[b] - corner[a]) + np.outer(at[1], corner[c] - corner[a])
        tet = owner[local == k]
        jacobian = np.einsum("tid,ikq->tqdk", solid.node_m[solid.tet[tet]], lagrange.gradients(2, point))
        across = np.cross(jacobian @ (corner[b] - corner[a]), jacobian @ (corner[c] - corner[a]))
        place = np.einsum("iq,tid->tqd", lagrange.values(2, point), solid.node_m[solid.tet[tet]])
        nearest, part, _ = geometry.closest_point(*skin, place.reshape(-1, 3), across.reshape(-1, 3))
        true = np.einsum("kc,kcx->kx", part, skin[0][skin[1][nearest]]).reshape(place.shape)
        swept = np.einsum("tqx,tqx,q->tq", true - place, across, weight)  # g dA
        off = np.linalg.norm(true - place, axis=2).max(axis=1, initial=0.0) > on_it
        if not off.any():
            continue
        tet, swept, slope = tet[off], swept[off], np.linalg.inv(jacobian[off])
        gradient = np.einsum("kdq,tqde->tqek", lagrange.gradients(field.degree, point), slope, optimize=True)
        shape = lagrange.values(field.degree, point).T
        for start in range(0, len(value), at_once):
            mine = slice(start, min(start + at_once, len(value)))
            moved = vector[:, mine].reshape(len(field.node_m), -1)[field.tet[tet]]
            rate = (gradient.reshape(len(tet), -1, gradient.shape[-1]) @ moved).reshape(*swept.shape, 9, -1)
            energy = np.einsum("tqim,tqim->tqm", law @ rate, rate)
            square = ((shape @ moved).reshape(*swept.shape, 3, -1) ** 2).sum(axis=2)
            change[mine] += np.einsum("tq,tqm->m", swept, energy - square * value[mine])
    return float(np.abs(change / value).max(initial=0.0)) / 2
