"""Points of a contact patch on both bodies: axes, motion of each mode and rigid motion along them, curvature.

    n, t₁, t₂ of the patch -> axes of either body's frame;   Φ = (axes · Σ_c w_c φ_c,  axes · (1/√M, (r ×) J^{−1/2}))

Rows of `BodyMobility.moves`, from the run time's tables: one call a pair, since new poles come while it sounds
(src/contact/coupling/patch_points.hpp).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import place_points
from sonic_bullet.records import Array
from sonic_bullet.runtime.body_table import BodyTable


class PlacedPoints(NamedTuple):
    """Points (k,) of a pair, on either body.

    moves: of both bodies, (k, 3, m + 6); curvature_per_m (k,): of both together; off_m: of the points' middle from the
    farther surface.
    """

    moves: tuple[Array, Array]
    curvature_per_m: Array
    off_m: float


def placed_points(table: BodyTable, quaternion: Array, patch: Array, both: Array, turns: Array) -> PlacedPoints:
    """Locate a patch, a row of CONTACT_PATCH, on bodies ``both`` (2,); turns (2, 3, 3): J^{−1/2} of either."""
    count = int(patch["count"])
    lower, higher = (np.zeros((count, 3, m + 6)) for m in table.bodies["modes"][both].tolist())
    curvature = np.zeros(count)
    both = np.ascontiguousarray(both)
    off_m = place_points(table, quaternion, np.atleast_1d(patch), both, turns, lower, higher, curvature)
    return PlacedPoints((lower, higher), curvature, off_m)
