"""Cache of bodies filled with elements: filling one takes as long as solving it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.files.storage import cache as store
from sonic_bullet.modal.meshing.solid import Solid, SolidSurface
from sonic_bullet.records import Array, Shape, TouchedSurface

if TYPE_CHECKING:
    from sonic_bullet.modal.meshing.filling import Filler
    from sonic_bullet.modal.meshing.shape_meshes import FilledBody


def pack_touched(surface: TouchedSurface | None) -> dict[str, Array]:
    """Return the arrays of the surface that a body is touched on, none where it is its own."""
    if surface is None:
        return {}
    return {"touched": surface.vertex_m, "touched_face": surface.face, "touched_curvature": surface.curvature_per_m}


def unpack_touched(arrays: Mapping[str, Array]) -> TouchedSurface | None:
    """Return the surface of `pack_touched`, from among other arrays."""
    if "touched" not in arrays:
        return None
    return TouchedSurface(arrays["touched"], arrays["touched_face"], arrays["touched_curvature"])


def kept_or_filled(
    shapes: tuple[Shape, ...],
    sizes: tuple[float | None, float | None],
    kept: tuple[store.Place, str],
    *,
    filler: Filler,
) -> FilledBody:
    """Load the body's inside and skin from the cache, or fill it. sizes: edge_m, thickness_m. Raises MeshError."""
    from sonic_bullet.modal.meshing.shape_meshes import FilledBody, fill

    found = store.load(*kept)
    if found is not None:
        a, note = found
        return FilledBody(
            Solid(a["node"], a["tet"], bool(a["affine"][0]), note, float(a["thickened"][0])),
            SolidSurface(a["skin"], a["face"]),
            a["curvature"],
            unpack_touched(a),
        )
    body = fill(shapes, *sizes, filler=filler)
    solid, skin = body.solid, body.skin
    arrays = {
        "node": solid.node_m,
        "tet": solid.tet,
        "affine": np.array([solid.affine]),
        "thickened": np.array([solid.thickened]),
        "skin": skin.node,
        "face": skin.face,
        "curvature": body.curvature_per_m,
        **pack_touched(body.touched),
    }
    store.save(*kept, arrays, solid.note)
    return body
