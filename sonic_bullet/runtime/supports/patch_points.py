"""Points of a contact patch on both bodies: axes, motion of each mode and rigid motion along them, curvature.

    n, t₁, t₂ of the patch -> axes of either body's frame;   Φ = (axes · Σ_c w_c φ_c,  axes · (1/√M, (r ×) J^{−1/2}))

Rows of `BodyMobility.moves`, from the run time's tables: one call a pair, since new poles come while it sounds.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np

from sonic_bullet._engine import CREASE_COS
from sonic_bullet.contact.contact_patches import CONTACT_PATCH
from sonic_bullet.geometry.nearest_point import nearest_face
from sonic_bullet.machine.compiled import njit
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


@njit(nogil=True, error_model="numpy")
def write_axes(quaternion, both, patch, axes):
    """Write normal and two tangents as rows (2, 3, 3), in either body's frame, the same directions for both."""
    turn = np.empty((2, 3, 3))
    for side in range(2):
        x, y, z, w = quaternion[both[side]]
        r = turn[side]
        r[0, 0], r[0, 1], r[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)
        r[1, 0], r[1, 1], r[1, 2] = 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)
        r[2, 0], r[2, 1], r[2, 2] = 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)
    n, r = patch.outward[0], turn[0]
    x = r[0, 0] * n[0] + r[0, 1] * n[1] + r[0, 2] * n[2]
    y = r[1, 0] * n[0] + r[1, 1] * n[1] + r[1, 2] * n[2]
    z = r[2, 0] * n[0] + r[2, 1] * n[1] + r[2, 2] * n[2]
    u, v, w = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
    length = np.sqrt(u * u + v * v + w * w)
    u, v, w = u / length, v / length, w / length
    world = ((x, y, z), (u, v, w), (y * w - z * v, z * u - x * w, x * v - y * u))
    for side in range(2):
        r = turn[side]
        for a in range(3):
            p, q, s = world[a]
            for i in range(3):
                axes[side, a, i] = p * r[0, i] + q * r[1, i] + s * r[2, i]


@njit(nogil=True, error_model="numpy")
def write_modes(body, face, weight, axes, shapes, moves):
    """Add axes (3, 3) times the shapes of a body's modes in a face, at weights (3 numbers), to moves (3, ≥ m)."""
    columns = body.columns
    for corner in range(3):
        at = body.shape_at + 3 * face.vertex[corner] * columns
        for i in range(3):
            along = shapes[at + i * columns : at + i * columns + body.modes]
            for a in range(3):
                factor, row = weight[corner] * axes[a, i], moves[a]
                for m in range(body.modes):
                    row[m] += factor * along[m]


@njit(nogil=True, error_model="numpy")
def write_rigid(body, point, axes, turn, moves):
    """Write the six rigid motions, behind the modes; turn (3, 3): J^{−1/2}, by columns."""
    x, y, z = point[0], point[1], point[2]
    root = np.sqrt(body.mass_kg)
    for a in range(3):
        u, v, w = axes[a, 0], axes[a, 1], axes[a, 2]
        lever = (w * y - v * z, u * z - w * x, v * x - u * y)  # of axis u: r × u
        for i in range(3):
            moves[a, body.modes + i] = axes[a, i] / root
            moves[a, body.modes + 3 + i] = lever[0] * turn[0, i] + lever[1] * turn[1, i] + lever[2] * turn[2, i]


@njit(nogil=True, error_model="numpy")
def place_points(table, quaternion, patch, both, turn, axes, moves, curvature):
    """Fill moves of both bodies, (k, 3, m + 6) of zeros each, and curvature (k,); return off_m.

    both (2,): the bodies; turn (2, 3, 3): J^{−1/2} of both; axes (2, 3, 3): filled too.
    """
    bodies, faces, nodes, shapes = table
    far, count = 0.0, patch.count
    write_axes(quaternion, both, patch, axes)
    for side in range(2):
        body, normal = bodies[both[side]], patch.outward[side]
        made = moves[0] if side == 0 else moves[1]
        n, middle, bent = (normal[0], normal[1], normal[2]), np.zeros(3), body.curvature_per_m
        for k in range(count + 1):
            point = patch.point_m[k, side] if k < count else middle / count
            for x in range(3):
                middle[x] += point[x]
            here = bent if np.isfinite(bent) else 0.0
            if body.faces > 0:
                number, u, v, w, off = nearest_face(
                    faces, body.face_at, nodes, body.node_at, body.wall_m, body.tie_m, (point[0], point[1], point[2]), n
                )
                if k == count:
                    far = max(far, off)
                    break
                face = faces[body.face_at + number]
                write_modes(body, face, (u, v, w), axes[side], shapes, made[k])
                leans = face.normal[0] * n[0] + face.normal[1] * n[1] + face.normal[2] * n[2] < CREASE_COS
                if not np.isfinite(bent):
                    here = body.edge_per_m if leans else face.curvature_per_m
            if k < count:
                curvature[k] += here
                if body.mass_kg > 0.0:
                    write_rigid(body, point, axes[side], turn[side], made[k])
    return far


def _arguments(table: BodyTable, quaternion: Array, patch: Any, both: Array, turns: Array, modes: list[int]) -> Any:
    count = int(patch["count"])
    moves = tuple(np.zeros((count, 3, m + 6)) for m in modes)
    tables = table.bodies, table.faces, table.nodes, table.shapes
    return tables, quaternion, patch, both, turns, np.empty((2, 3, 3)), moves, np.zeros(count)


def placed_points(table: BodyTable, quaternion: Array, patch: Array, both: Array, turns: Array) -> PlacedPoints:
    """Locate a patch, a row of CONTACT_PATCH, on bodies ``both`` (2,); turns (2, 3, 3): J^{−1/2} of either."""
    given = _arguments(table, quaternion, patch, both, turns, table.bodies["modes"][both].tolist())
    off = place_points(*given)
    return PlacedPoints(given[-2], given[-1], off)


def make_ready() -> None:
    """Compile the kernel, or load its machine code."""
    patch, both = np.zeros(1, CONTACT_PATCH)[0], np.zeros(2, np.int64)
    given = _arguments(BodyTable(), np.zeros((0, 4)), patch, both, np.zeros((2, 3, 3)), [0, 0])
    place_points.compile(tuple(numba.typeof(one) for one in given))
