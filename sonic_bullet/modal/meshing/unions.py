"""Union of closed pieces that mean one body, the walls between them gone.

Simulators' meshes are often convex pieces side by side (V-HACD). They overlap, touch, or leave gaps far below what
matters for sound, and a solid of separate pieces would ring as its largest one alone.

    pieces, each closed and positive -> exact union (Manifold)  -> one piece?
        else the pieces grown a little and united again

A piece with negative volume is a cavity: then nothing is united, and the filler's winding number decides.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sonic_bullet import geometry
from sonic_bullet.records import Array


def unite_pieces(vertex_m: Array, face: Array, piece: Array) -> tuple[Array, Array, str, bool]:
    """Unite a closed surface's pieces, piece (f,) their labels.

    Returns vertices, faces, what was done ("": nothing), and whether the pieces met only grown.
    """
    one = 0.99  # of the volume in the largest piece: the rest is negligible
    import manifold3d

    count = int(piece.max()) + 1
    parts = []
    for label in range(count):
        used, mine = np.unique(face[piece == label], return_inverse=True)
        mine = mine.reshape(-1, 3)
        if not geometry.is_closed(mine) or geometry.volume_m3(vertex_m[used], mine) <= 0:
            return vertex_m, face, "", False
        parts.append((vertex_m[used], mine))
    diagonal_m = float(np.linalg.norm(np.ptp(vertex_m[np.unique(face)], axis=0)))
    first: tuple[Array, Array, str, bool] | None = None
    # of the diagonal: how far each piece's surface moves outward; the least that joins them is taken
    growths = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)
    for growth in growths:
        solids = [_solid(vertex + growth * diagonal_m * _outward(vertex, mine), mine) for vertex, mine in parts]
        if any(solid.status() != manifold3d.Error.NoError for solid in solids):
            return vertex_m, face, "", False
        union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
        volumes = [piece.volume() for piece in union.decompose()]
        if not volumes:
            return vertex_m, face, "", False
        if max(volumes) >= one * sum(volumes):
            grown = f", each grown by {growth * diagonal_m:.2g} m to close the gaps between them" if growth else ""
            return (*_arrays(union), f"; {count} pieces united{grown}", growth > 0)
        if first is None:
            first = (*_arrays(union), f"; {count} pieces united into {len(volumes)} that lie apart", False)
    assert first is not None
    return first


def _outward(vertex_m: Array, face: Array) -> Array:
    """Compute how the vertices (v, 3) move when every face moves outward by one.

    The u with n·u = 1 on the faces around, by least squares. Directions that the normals hardly span (a flat or gently
    bent neighbourhood) are left alone, a spike moves by three at most.
    """
    corner = vertex_m[face]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    at = face.ravel()
    spread = np.repeat(np.einsum("fi,fj->fij", normal, normal).reshape(-1, 9), 3, axis=0)
    outer = np.stack([np.bincount(at, spread[:, k], len(vertex_m)) for k in range(9)], axis=1).reshape(-1, 3, 3)
    total = np.stack([np.bincount(at, np.repeat(normal[:, x], 3), len(vertex_m)) for x in range(3)], axis=1)
    move = np.einsum("vij,vj->vi", np.linalg.pinv(outer, rcond=0.05, hermitian=True), total)
    length = np.linalg.norm(move, axis=1, keepdims=True)
    return np.asarray(move * np.minimum(1, 3 / np.maximum(length, 1e-300)))


def _solid(vertex_m: Array, face: Array) -> Any:
    import manifold3d

    return manifold3d.Manifold(
        manifold3d.Mesh64(np.ascontiguousarray(vertex_m, np.float64), np.ascontiguousarray(face, np.uint64))
    )


def _arrays(solid: Any) -> tuple[Array, Array]:
    mesh = solid.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts).astype(np.int64)
