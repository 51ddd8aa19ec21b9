"""Rotation matrix of a quaternion, without the import of scipy.spatial, which takes 0.3 s."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def rotation_matrix(quaternion_xyzw: Array) -> Array:
    """Compute the matrix (3, 3) of a quaternion (4,) of any length but zero [Kuipers 1999, eq. 5.9].

    The same bits as `scipy.spatial.transform.Rotation.from_quat(…).as_matrix()`, and its ValueError for zero.
    """
    x, y, z, w = (float(part) for part in quaternion_xyzw)
    length = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not length > 0:
        raise ValueError("quaternion of no length")
    x, y, z, w = x / length, y / length, z / length, w / length
    return np.array(
        [
            [x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), -x * x + y * y - z * z + w * w, 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), -x * x - y * y + z * z + w * w],
        ]
    )
