"""Rotation matrices of quaternions (x, y, z, w), vectorised over rows [Kuipers, Quaternions and Rotation Sequences,
1999, sec. 5.15].
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def matrix(quaternion_xyzw: Array) -> Array:
    """Rotation matrices (k, 3, 3), body to world, of quaternions (k, 4)."""
    q = quaternion_xyzw / np.linalg.norm(quaternion_xyzw, axis=-1, keepdims=True)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
