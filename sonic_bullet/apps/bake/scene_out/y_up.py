"""World with z up -> glTF's with y up: (x, z, -y), the inverse of `session.gltf_in.node_frames.UPRIGHT`."""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def place_y_up(position_m: Array) -> Array:
    """Turn vectors (…, 3) of the world."""
    return np.stack([position_m[..., 0], position_m[..., 2], -position_m[..., 1]], axis=-1)


def turn_y_up(quaternion_xyzw: Array) -> Array:
    """Turn orientations (…, 4): a quarter turn back about x after them, of unit length."""
    x, y, z, w = np.moveaxis(np.asarray(quaternion_xyzw, float), -1, 0)
    root_half = np.sqrt(0.5)
    made = root_half * np.stack([x - w, y + z, z - y, w + x], axis=-1)
    return np.asarray(made / np.linalg.norm(made, axis=-1, keepdims=True))
