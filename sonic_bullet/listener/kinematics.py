"""What two bodies do to each other at a contact, from their poses and twists before the step.

    p' = Rᵀ(p - x)                               the point in a body's frame
    v = V + ω × (p - x)                          velocity of the material there
    approach = -(v_a - v_b)·n                    closing speed, n from b to a
    slip = (v_a - v_b) - ((v_a - v_b)·n) n       tangential velocity of a's material relative to b's

One compiled pass over k rows: numpy would spend more on calls than on arithmetic.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.records import Array


@njit(cache=True, fastmath=False, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def turn(qx: float, qy: float, qz: float, qw: float, x: float, y: float, z: float) -> tuple[float, float, float]:  # noqa: PLR0917
    """Rotate (x, y, z) by a unit quaternion: v + 2 w (q × v) + 2 q × (q × v)."""
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return x + qw * cx + qy * cz - qz * cy, y + qw * cy + qz * cx - qx * cz, z + qw * cz + qx * cy - qy * cx


@njit(cache=True, fastmath=False, nogil=True)  # type: ignore[untyped-decorator]
def into_frame(point: Array, position: Array, quaternion: Array) -> Array:
    """Points (k, 3) of the world in the frames at position (k, 3), quaternion (k, 4)."""
    result = np.empty((len(point), 3))
    for i in range(len(point)):
        q = quaternion[i]
        result[i] = turn(-q[0], -q[1], -q[2], q[3], point[i, 0] - position[i, 0], point[i, 1] - position[i, 1], point[i, 2] - position[i, 2])
    return result


@njit(cache=True, fastmath=False, nogil=True)  # type: ignore[untyped-decorator]
def relative_motion(  # noqa: PLR0917
    point_a: Array, point_b: Array, normal: Array, position: Array, velocity: Array, spin: Array, row_a: Array, row_b: Array
) -> tuple[Array, Array]:
    """slip (k, 3) and approach (k,) in m/s at points (k, 3); bodies' position, velocity, spin (n, 3) are looked up by row (k,)."""
    slip, approach = np.empty((len(normal), 3)), np.empty(len(normal))
    for i in range(len(normal)):
        a, b = row_a[i], row_b[i]
        xa, xb, va, vb, wa, wb = position[a], position[b], velocity[a], velocity[b], spin[a], spin[b]
        rx, ry, rz = point_a[i, 0] - xa[0], point_a[i, 1] - xa[1], point_a[i, 2] - xa[2]
        sx, sy, sz = point_b[i, 0] - xb[0], point_b[i, 1] - xb[1], point_b[i, 2] - xb[2]
        ux = va[0] + wa[1] * rz - wa[2] * ry - vb[0] - wb[1] * sz + wb[2] * sy
        uy = va[1] + wa[2] * rx - wa[0] * rz - vb[1] - wb[2] * sx + wb[0] * sz
        uz = va[2] + wa[0] * ry - wa[1] * rx - vb[2] - wb[0] * sy + wb[1] * sx
        n = normal[i]
        along = ux * n[0] + uy * n[1] + uz * n[2]
        approach[i] = -along
        slip[i, 0], slip[i, 1], slip[i, 2] = ux - along * n[0], uy - along * n[1], uz - along * n[2]
    return slip, approach
