"""Whether a microphone lies within what rings: there is no air in it.

    w(x) = 1/4π Σ_faces Ω(x),   Ω solid angle of a triangle [Van Oosterom & Strackee 1983, eq. 8]

|w| is 1 inside of a closed surface and 0 outside; more than a half counts as inside. A hollow of a cup is outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.engine.path.space.receiver_places import turn_back
from sonic_bullet.records import Array, Body, Microphone
from sonic_bullet.records.errors import AudioError
from sonic_bullet.records.simulated import with_body_id


def check_outside(
    microphones: Sequence[Microphone], bodies: Sequence[Body], position_m: Array, quaternion_xyzw: Array
) -> None:
    """Raise AudioError where a microphone begins within one of the bodies at poses (k, 3), (k, 4)."""
    solid = [k for k, body in enumerate(bodies) if body.model is not None and len(body.model.face)]
    vertices = [bodies[k].model.vertex_m for k in solid]  # type: ignore[union-attr]
    least = np.array([vertex.min(axis=0) for vertex in vertices]).reshape(-1, 3)
    most = np.array([vertex.max(axis=0) for vertex in vertices]).reshape(-1, 3)
    for c, one in enumerate(microphones):
        if one.body_id is None:
            place = turn_back(quaternion_xyzw[solid], one.position_m - position_m[solid])
        else:
            own = [(one.body_id, one.link) == (bodies[k].body_id, bodies[k].link) for k in solid]
            place = np.where(np.array(own, bool)[:, None], one.position_m, np.nan)
        for n in np.flatnonzero(((place >= least) & (place <= most)).all(axis=1)):
            body, vertex, here = bodies[solid[n]], vertices[n], place[n]
            assert body.model is not None
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
