"""Places that a search tries: apart from each other on a surface, and those that no line tells apart."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.common.points import nearest, vertex_normals
from sonic_bullet.records import Array, ModalModel


def spread_out(x: ModalModel, count: int) -> Array:
    """Select about ``count`` surface vertices (p,), each the farthest from those before it [Gonzalez 1985]."""
    body = np.unique(x.face)
    at = x.vertex_m[body]
    selected = [0]
    gap = ((at - at[0]) ** 2).sum(axis=1)
    for _ in range(min(count, len(body)) - 1):
        selected.append(int(gap.argmax()))
        gap = np.minimum(gap, ((at - at[selected[-1]]) ** 2).sum(axis=1))
    return np.asarray(body[selected])


def places_alike(x: ModalModel, place: tuple[float, float, float]) -> Array:
    """Find the other places (p, 3) of the surface that move as much as one in every mode: images under a symmetry.

    To first order a dashpot takes ½ c (n·φ_k)² and a mass −½ m |φ_k|² wherever it is, so lines cannot separate these
    places; nor one dashpot at one of them from two that share its strength.
    """
    alike, apart = 0.15, 0.1  # relative difference of (n·φ)² over all modes; of the body's size
    body, at = np.unique(x.face), nearest(x, place)
    square = np.einsum("vx,vxm->vm", vertex_normals(x)[body], x.shape[body].astype(float)) ** 2
    square /= np.maximum(square.mean(axis=0), 1e-300)
    own, where = square[int(np.flatnonzero(body == at)[0])], x.vertex_m[body]
    off = np.linalg.norm(square - own, axis=1) / max(float(np.linalg.norm(own)), 1e-300)
    near, found = apart * float(np.linalg.norm(np.ptp(where, axis=0))), [x.vertex_m[at]]
    for v in np.argsort(off, kind="stable"):
        if not own.any() or off[v] > alike:
            break
        if min(float(np.linalg.norm(where[v] - other)) for other in found) > near:
            found.append(where[v])
    return np.array(found[1:]).reshape(-1, 3)
