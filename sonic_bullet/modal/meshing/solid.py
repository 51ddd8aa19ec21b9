"""A body filled with quadratic tetrahedra, and its surface.

    corners and tetrahedra -> Solid (corner nodes, then one node in the middle of each edge) -> Surface (its boundary,
        each
    quadratic face cut into four flat triangles, so that interpolating in a triangle follows the quadratic field)

Local node order is scikit-fem's `ElementTetP2`: corners 0 1 2 3, then the edges 01 12 02 03 13 23.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sonic_bullet.geometry import label_components
from sonic_bullet.records import Array
from sonic_bullet.records.errors import MeshError

TET_EDGE = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
# Faces of a positively oriented tetrahedron seen from outside: three corners, then the nodes on their edges 01, 12, 20.
TET_FACE = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [0, 3, 2, 7, 9, 6]])
# One quadratic triangle (corners 0 1 2, middles 3 4 5) as four flat ones.
QUARTERS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """Quadratic tetrahedra.

    Attributes
    ----------
    node_m : (n, 3) corners first
    tet : (t, 10) indices into node_m
    affine : whether all middles lie halfway
    note : how it was made
    thickened : how many times as thick its walls are as the body's
    """

    node_m: Array
    tet: Array
    affine: bool = True
    note: str = ""
    thickened: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class SolidSurface:
    """Surface of a solid: node (v,) indices of the solid's nodes on it, face (f, 3) indices into ``node``, outward."""

    node: Array
    face: Array


def corner_volume_m3(corner_m: Array, tet: Array) -> Array:
    """Compute the signed volumes (t,) of straight tetrahedra tet (t, >=4) over corner_m (n, 3)."""
    a, b, c, d = (corner_m[tet[:, k]] for k in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6)


def quadratic(corner_m: Array, tet: Array, place: Callable[[Array], Array] | None = None, note: str = "") -> Solid:
    """Make a solid of tetrahedra tet (t, 4).

    Orients them, drops unused corners and flat elements, adds the nodes in the middle of the edges. ``place`` maps all
    nodes (n, 3) to where they really are (curved bodies are meshed straight and then placed). Raises MeshError where no
    element has a volume.
    """
    volume = corner_volume_m3(corner_m, tet)
    tet = np.where((volume < 0)[:, None], tet[:, [0, 2, 1, 3]], tet)
    volume = np.abs(volume)
    keep = volume > 1e-9 * (volume.mean() if len(volume) else 0)
    if not keep.any():
        raise MeshError("mesh fills no volume", "close the surface or give thickness_m")
    tet = tet[keep]
    used, tet = np.unique(tet, return_inverse=True)
    corner_m, tet = corner_m[used], tet.reshape(-1, 4)
    n = len(corner_m)
    pair = np.sort(tet[:, TET_EDGE], axis=2).reshape(-1, 2).astype(np.int64)
    code, inverse = np.unique(pair[:, 0] * n + pair[:, 1], return_inverse=True)
    middle_m = (corner_m[code // n] + corner_m[code % n]) / 2
    node_m = np.concatenate([corner_m, middle_m])
    if place is not None:
        node_m = place(node_m)
    return Solid(node_m, np.concatenate([tet, n + inverse.reshape(-1, 6)], axis=1), place is None, note)


def largest_component(corner_m: Array, tet: Array) -> tuple[Array, str]:
    """Return the tetrahedra (t', 4) of the largest piece joined through shared faces, and what was left out."""
    t = len(tet)
    faces = np.sort(tet[:, TET_FACE[:, :3]], axis=2).reshape(-1, 3)
    owner = np.repeat(np.arange(t), 4)
    order = np.lexsort(faces.T)
    same = np.flatnonzero((faces[order][1:] == faces[order][:-1]).all(axis=1))
    a, b = owner[order[same]], owner[order[same + 1]]
    label = label_components(t, a, b)
    pieces = int(label.max(initial=0)) + 1
    if pieces == 1:
        return tet, ""
    volume = np.bincount(label, np.abs(corner_volume_m3(corner_m, tet)))
    return tet[label == np.argmax(volume)], f"; largest of {pieces} separate pieces kept"


def outer_faces(solid: Solid) -> Array:
    """Return the faces (k, 6) that belong to one tetrahedron only: three corners, then the middles of 01, 12, 20."""
    owner, local = outer_places(solid)
    return np.asarray(solid.tet[owner[:, None], TET_FACE[local]])


def outer_places(solid: Solid) -> tuple[Array, Array]:
    """Return the tetrahedron (k,) that has each outer face, and the face's row (k,) in `TET_FACE`."""
    key = np.sort(solid.tet[:, TET_FACE[:, :3]].reshape(-1, 3), axis=1)
    order = np.lexsort(key.T)
    ranked = key[order]
    same = (ranked[1:] == ranked[:-1]).all(axis=1)
    single = np.ones(len(key), bool)
    single[1:] &= ~same
    single[:-1] &= ~same
    owner, local = np.divmod(np.sort(order[single]), len(TET_FACE))
    return owner, local


def surface(solid: Solid) -> SolidSurface:
    """Extract the boundary of a solid: every face that belongs to one tetrahedron only, cut into four triangles."""
    outer = outer_faces(solid)
    triangle = outer[:, QUARTERS].reshape(-1, 3)
    node, face = np.unique(triangle, return_inverse=True)
    return SolidSurface(node, face.reshape(-1, 3).astype(np.int32))
