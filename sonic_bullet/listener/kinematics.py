"""Relative motion of two bodies at a contact, from their poses and twists before the step.

    p' = Rᵀ(p - x)                               the point in a body's frame
    v = V + ω × (p - x)                          velocity of the material there
    approach = -(v_a - v_b)·n                    closing speed, n from b to a
    slip = (v_a - v_b) - ((v_a - v_b)·n) n       tangential velocity of a's material relative to b's

Compiled, on rows of `frames.MOTION` or of a dtype that begins with its fields.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.machine.compiled import njit


@njit(nogil=True, error_model="numpy")
def turn(qx, qy, qz, qw, x, y, z):
    """Rotate (x, y, z) by a unit quaternion: v + 2 w (q × v) + 2 q × (q × v)."""
    cx, cy, cz = 2 * (qy * z - qz * y), 2 * (qz * x - qx * z), 2 * (qx * y - qy * x)
    return x + qw * cx + qy * cz - qz * cy, y + qw * cy + qz * cx - qx * cz, z + qw * cz + qx * cy - qy * cx


@njit(nogil=True, error_model="numpy")
def pose_after(body, elapsed, position, quaternion):
    """Write a body's pose `elapsed` seconds into the step, by its twist before it: position (3,), quaternion (4,)."""
    q, w = body.quaternion_xyzw, body.spin_rad_s
    for x in range(3):
        position[x] = body.position_m[x] + elapsed * body.velocity_m_s[x]
    angle = elapsed * np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if angle == 0:
        for x in range(4):
            quaternion[x] = q[x]
        return
    s, c = elapsed * np.sin(angle / 2) / angle, np.cos(angle / 2)
    a, b, d = s * w[0], s * w[1], s * w[2]
    quaternion[0] = c * q[0] + a * q[3] + b * q[2] - d * q[1]
    quaternion[1] = c * q[1] + b * q[3] + d * q[0] - a * q[2]
    quaternion[2] = c * q[2] + d * q[3] + a * q[1] - b * q[0]
    quaternion[3] = c * q[3] - a * q[0] - b * q[1] - d * q[2]


@njit(nogil=True, error_model="numpy")
def relative_motion(touch, a, b, slip):
    """Return the approach in m/s of bodies a, b at a contact and write their slip in m/s to slip (3,)."""
    p, q, n = touch.point_a_m, touch.point_b_m, touch.normal
    va, vb, wa, wb = a.velocity_m_s, b.velocity_m_s, a.spin_rad_s, b.spin_rad_s
    rx, ry, rz = p[0] - a.position_m[0], p[1] - a.position_m[1], p[2] - a.position_m[2]
    sx, sy, sz = q[0] - b.position_m[0], q[1] - b.position_m[1], q[2] - b.position_m[2]
    ux = va[0] + wa[1] * rz - wa[2] * ry - vb[0] - wb[1] * sz + wb[2] * sy
    uy = va[1] + wa[2] * rx - wa[0] * rz - vb[1] - wb[2] * sx + wb[0] * sz
    uz = va[2] + wa[0] * ry - wa[1] * rx - vb[2] - wb[0] * sy + wb[1] * sx
    along = ux * n[0] + uy * n[1] + uz * n[2]
    slip[0], slip[1], slip[2] = ux - along * n[0], uy - along * n[1], uz - along * n[2]
    return -along


@njit(nogil=True, error_model="numpy")
def rotation_between(first, second, vector):
    """Write the rotation vector (3,) in rad, world frame, between two orientations xyzw (4,)."""
    w, v = first[3], second[3]
    scalar = w * v + (first[0] * second[0] + first[1] * second[1] + first[2] * second[2])
    vector[0] = w * second[0] - v * first[0] - (second[1] * first[2] - second[2] * first[1])
    vector[1] = w * second[1] - v * first[1] - (second[2] * first[0] - second[0] * first[2])
    vector[2] = w * second[2] - v * first[2] - (second[0] * first[1] - second[1] * first[0])
    length = np.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    scale = 2 * np.arctan2(length, abs(scalar)) / max(length, 1e-300)
    for x in range(3):
        vector[x] *= -scale if scalar < 0 else scale
