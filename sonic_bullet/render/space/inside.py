"""Whether a microphone lies within what rings: there is no air in it.

    w(x) = 1/4π Σ_faces Ω(x),   Ω solid angle of a triangle [Van Oosterom & Strackee 1983, eq. 8]

|w| is 1 inside of a closed surface and 0 outside; more than a half counts as inside. A hollow of a cup is outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.records import Array, Body, Microphone
from sonic_bullet.records.errors import AudioError
from sonic_bullet.records.simulated import with_body_id
from sonic_bullet.render.space.receiver_places import turn_back


def check_outside(
    microphones: Sequence[Microphone], bodies: Sequence[Body], position_m: Array, quaternion_xyzw: Array
) -> None:
    """Raise AudioError where a microphone begins within one of the bodies at poses (k, 3), (k, 4)."""
    for c, one in enumerate(microphones):
        for body, place, turned in zip(bodies, position_m, quaternion_xyzw, strict=True):
            if body.model is None or not len(body.model.face):
                continue
            if one.body_id is None:
                here = turn_back(turned, one.position_m - place)
            elif (one.body_id, one.link) == (body.body_id, body.link):
                here = one.position_m
            else:
                continue
            vertex = body.model.vertex_m
            if (here < vertex.min(axis=0)).any() or (here > vertex.max(axis=0)).any():
                continue
            if abs(winding_number(here, vertex[body.model.face])) > 0.5:
                raise AudioError(
                    f"microphone {c} lies within {with_body_id(body.name, body.body_id)}",
                    "move it out: 1 cm from the surface is enough",
                )


def winding_number(point: Array, corner: Array) -> float:
    """Count how often triangles (f, 3, 3) go round a point (3,)."""
    a, b, c = np.moveaxis(corner - point, 1, 0)
    la, lb, lc = (np.linalg.norm(one, axis=1) for one in (a, b, c))
    volume = np.einsum("fi,fi->f", a, np.cross(b, c))
    others = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return float(2 * np.arctan2(volume, others).sum() / (4 * np.pi))
