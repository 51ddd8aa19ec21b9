"""What two bodies do to each other at a contact, from their poses and twists before the step.

    p' = Rᵀ(p - x)                               the point in a body's frame
    v = V + ω × (p - x)                          velocity of the material there
    approach = -(v_a - v_b)·n                    closing speed, n from b to a
    slip = (v_a - v_b) - ((v_a - v_b)·n) n       tangential velocity of a's material relative to b's

Compiled passes over k contacts and n bodies: numpy would spend more on calls than on arithmetic.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

Table = tuple[Array, Array, Array, Array]
"""Columns of a Motion: position (n, 3), quaternion xyzw (n, 4), velocity (n, 3), spin (n, 3)."""


@njit(fastmath=False, nogil=True, inline="always")
def turn(qx: float, qy: float, qz: float, qw: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rotate (x, y, z) by a unit quaternion: v + 2 w (q × v) + 2 q × (q × v)."""
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return x + qw * cx + qy * cz - qz * cy, y + qw * cy + qz * cx - qx * cz, z + qw * cz + qx * cy - qy * cx


@njit(fastmath=False, nogil=True)
def pose_after(table: Table, row: int, elapsed: float, position: Array, quaternion: Array) -> None:
    """Position (3,) and orientation (4,) of a body `elapsed` seconds into the step, by its twist before it, written in
    place.
    """
    x, q, v, w = table[0][row], table[1][row], table[2][row], table[3][row]
    for i in range(3):
        position[i] = x[i] + elapsed * v[i]
    angle = elapsed * np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if angle == 0:
        quaternion[:] = q
        return
    s, c = elapsed * np.sin(angle / 2) / angle, np.cos(angle / 2)
    a, b, d = s * w[0], s * w[1], s * w[2]
    quaternion[0] = c * q[0] + a * q[3] + b * q[2] - d * q[1]
    quaternion[1] = c * q[1] + b * q[3] + d * q[0] - a * q[2]
    quaternion[2] = c * q[2] + d * q[3] + a * q[1] - b * q[0]
    quaternion[3] = c * q[3] - a * q[0] - b * q[1] - d * q[2]


@njit(fastmath=False, nogil=True)
def relative_motion(
    point_a: Array, point_b: Array, normal: Array, table: Table, row_a: Array, row_b: Array
) -> tuple[Array, Array]:
    """slip (k, 3) and approach (k,) in m/s at points (k, 3) of the bodies in rows row_a, row_b (k,)."""
    position, _, velocity, spin = table
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


@njit(fastmath=False, nogil=True)
def impulses(dt: float, normal: Array, tangent_1: Array, tangent_2: Array, force: Array) -> Array:
    """J (k, 3) in N·s of forces (3, k) along normal and both tangents (k, 3)."""
    result = np.empty_like(normal)
    for i in range(len(normal)):
        for x in range(3):
            result[i, x] = dt * (
                force[0, i] * normal[i, x] + force[1, i] * tangent_1[i, x] + force[2, i] * tangent_2[i, x]
            )
    return result


@njit(fastmath=False, nogil=True)
def jumps(earlier: Table, later: Table, old: Array, static: Array, dt: float, driven: float, floor: float) -> Array:
    """(n,) of `later`: farther from its row `old` (n,) of `earlier` than 1.5 × both speeds (static: `driven`) · dt +
    floor; never where old < 0.
    """
    result = np.zeros(len(old), np.bool_)
    for i in range(len(old)):
        j = old[i]
        if j < 0:
            continue
        moved, v, w = 0.0, 0.0, 0.0
        for x in range(3):
            moved += (later[0][i, x] - earlier[0][j, x]) ** 2
            v += later[2][i, x] ** 2
            w += earlier[2][j, x] ** 2
        reach = driven if static[i] else 1.5 * (np.sqrt(v) + np.sqrt(w))
        result[i] = np.sqrt(moved) > reach * dt + floor
    return result
