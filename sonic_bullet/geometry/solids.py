"""Volume, centre of mass and inertia of shapes, each a solid of one density; overlaps count twice.

    Shape -> triangles or closed forms, own frame -> placed, summed about the common centre

References
----------
Closed forms and the parallel axis theorem: Goldstein, Classical Mechanics (2002), sec. 5.3; a capsule is a cylinder and
the two halves of a ball, each at 3r/8 from its flat side.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.geometry.triangles import inertia, volume_m3
from sonic_bullet.geometry.turns import rotation_matrix
from sonic_bullet.records import Array, Shape


def solid_of(shapes: Sequence[Shape]) -> tuple[float, Array, Array]:
    """Compute volume in m³, centre (3,) in m and inertia (3, 3) about it in m⁵, for 1 kg/m³; zeros of planes alone."""
    parts = [_place_solid(shape) for shape in shapes if shape.kind != "plane"]
    total = sum(volume for volume, _, _ in parts)
    if total <= 0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = np.sum([volume * place for volume, place, _ in parts], axis=0) / total
    about = np.zeros((3, 3))
    for volume, place, own in parts:
        arm = place - centre
        about += own + volume * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return float(total), centre, about


def shape_volume_m3(shape: Shape) -> float:
    """Compute the volume of a shape; 0 of a plane."""
    return 0.0 if shape.kind == "plane" else _own(shape)[0]


def _place_solid(shape: Shape) -> tuple[float, Array, Array]:
    volume, centre, moment = _own(shape)
    turn = rotation_matrix(shape.quaternion_xyzw)
    return volume, shape.position_m + turn @ centre, turn @ moment @ turn.T


def _own(shape: Shape) -> tuple[float, Array, Array]:
    """Return volume, centre and inertia of a shape in its own frame."""
    if shape.kind == "mesh":
        sign = np.sign(volume_m3(shape.vertex_m, shape.face))
        if sign == 0:
            return 0.0, np.zeros(3), np.zeros((3, 3))
        volume, centre, moment = inertia(shape.vertex_m, shape.face, 1.0)
        return abs(volume), centre, sign * moment
    x, y, z = (float(size) for size in shape.size_m)
    if shape.kind == "box":
        volume = x * y * z
        return volume, np.zeros(3), np.diag(volume / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y]))
    ball = 0.0 if shape.kind == "cylinder" else 4 / 3 * np.pi * x**3
    long = 0.0 if shape.kind == "sphere" else y
    rod = np.pi * x * x * long
    across = rod * (long**2 / 12 + x * x / 4) + ball * (0.4 * x * x + long**2 / 4 + 3 / 8 * long * x)
    along = rod * x * x / 2 + ball * 0.4 * x * x
    return ball + rod, np.zeros(3), np.diag([across, across, along])
