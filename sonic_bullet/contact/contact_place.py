"""Location of a contact on both bodies' true surfaces, and its force on their modes: for strikes and friction.

    row of ROW -> touch: nearest triangle, weights, curvature, once a row -> add_modal_impulse: Uᵀj of either body
    1/m* = Σ [1/m + (r×n)·I⁻¹(r×n)]    [Johnson 1985, sec. 11.1]

Plain functions on the tables of `sonic_bullet.runtime.tables`, called by the stages of the run time. Triangles are
looked up only for rows with a strike or friction: each stage calls `touch` for those it needs.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.geometry.nearest_point import nearest_face
from sonic_bullet.machine.compiled import njit

CREASE_COS = np.cos(np.radians(20.0))
"""A contact whose normal leans more from the face's touches an edge or corner."""
FLAT_CURVATURE = 0.1
"""Curvature times size below which a contact is flat: a cap of ten times the body's size."""
SIZELESS_M = 0.1
"""Size of a pair of which neither body has a volume (planes and links without a solid)."""


@njit(nogil=True, error_model="numpy")
def touch(rows, r, table):
    """Find face, weights and curvature of row r on either body: its fields face, barycentric, curvature_per_m.

    Nothing is done where they are known already. Where the contact's normal leans more than 20° from the face's, an
    edge or corner is touched: its curvature is the body's edge_per_m.
    """
    row = rows[r]
    if row.touched:
        return
    row.touched = 1
    for side in range(2):
        body = table.bodies[row.body[side]]
        bent = body.curvature_per_m
        face, u, v, w = -1, 0.0, 0.0, 0.0
        if body.faces > 0:
            p, n = row.point_m[side], row.outward[side]
            face, u, v, w, _ = nearest_face(
                table.faces,
                body.face_at,
                table.nodes,
                body.node_at,
                body.wall_m,
                body.tie_m,
                (p[0], p[1], p[2]),
                (n[0], n[1], n[2]),
            )
            if not np.isfinite(bent):
                here = table.faces[body.face_at + face]
                normal = here.normal
                leans = normal[0] * n[0] + normal[1] * n[1] + normal[2] * n[2] < CREASE_COS
                bent = body.edge_per_m if leans else here.curvature_per_m
        weight = row.barycentric[side]
        row.face[side] = face
        weight[0], weight[1], weight[2] = u, v, w
        row.curvature_per_m[side] = bent if np.isfinite(bent) else 0.0


@njit(nogil=True, error_model="numpy")
def add_modal_impulse(rows, r, side, factor, table, out):
    """Add factor·Uᵀj of row r on the body of a side, of its free modes, to out (columns,).

    Uᵀj: the shapes, linear in the triangle, times the row's impulse in N·s (with factor 1: N·s/√kg). `touch` the row
    first. The shapes are flat float32, see BODY.shape_at. out may be longer than the body's columns.
    """
    row, shapes = rows[r], table.shapes
    body = table.bodies[row.body[side]]
    if row.face[side] < 0:
        return
    impulse, weight, vertex = (
        row.local_impulse_n_s[side],
        row.barycentric[side],
        table.faces[body.face_at + row.face[side]].vertex,
    )
    x, y, z = factor * impulse[0], factor * impulse[1], factor * impulse[2]
    columns = body.columns
    for corner in range(3):
        at = body.shape_at + 3 * vertex[corner] * columns
        u = weight[corner]
        along_x, along_y, along_z = (
            shapes[at : at + columns],
            shapes[at + columns : at + 2 * columns],
            shapes[at + 2 * columns : at + 3 * columns],
        )
        for c in range(columns):
            out[c] = out[c] + u * x * along_x[c] + u * y * along_y[c] + u * z * along_z[c]


@njit(nogil=True, error_model="numpy")
def turn_modal_impulse(body, turns, out):
    """Turn Uᵀj in out (columns,), of a body's free modes, to its modes as they are: Rᵀ Uᵀj of each of its pairs."""
    for q in range(body.turns):
        pair = turns[body.turn_at + q]
        k, by = pair.mode, pair.by
        one, other = out[k], out[k + 1]
        out[k] = one * by[0, 0] + other * by[1, 0]
        out[k + 1] = one * by[0, 1] + other * by[1, 1]


@njit(nogil=True, error_model="numpy")
def jointed_mobility(mobility, q, r, n):
    """Compute the speed along n (3,) per impulse along it at r (3,), world frame: gᵀ W g, g = (n, r × n) turned back.

    mobility W (6, 6) in the frame that q (4,) turns into the world.
    """
    g = np.empty(6)
    turn = r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]
    x, y, z, w = q[0], q[1], q[2], q[3]
    s = 2 / (x * x + y * y + z * z + w * w)
    for at, (a, b, c) in ((0, (n[0], n[1], n[2])), (3, turn)):
        i, j, k = s * (y * c - z * b), s * (z * a - x * c), s * (x * b - y * a)
        g[at], g[at + 1], g[at + 2] = a - w * i + y * k - z * j, b - w * j + z * i - x * k, c - w * k + x * j - y * i
    total = 0.0
    for row in range(6):
        for column in range(6):
            total += g[row] * mobility[row, column] * g[column]
    return total


@njit(nogil=True, error_model="numpy")
def effective_mass(bodies, low, high, quaternion, arm_low, arm_high, normal):
    """Compute m* in kg of two bodies, 0 where neither moves.

    quaternion (b, 4) of all; levers from their centres to the contact and normal (3,), in the world.
    """
    mobility, n = 0.0, normal
    for side in range(2):
        body, q, r = (
            (bodies[low], quaternion[low], arm_low) if side == 0 else (bodies[high], quaternion[high], arm_high)
        )
        if body.jointed:
            mobility += jointed_mobility(body.mobility, q, r, n)
        elif body.mass_kg > 0:
            mobility += 1 / body.mass_kg
            # the rotational part is a scalar: computed in the body's frame, where its inertia is
            a, b, c = r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]
            x, y, z, w = q[0], q[1], q[2], q[3]
            s = 2 / (x * x + y * y + z * z + w * w)  # v - w·t + u×t,  t = 2u×v: back by the quaternion (u, w)
            i, j, k = s * (y * c - z * b), s * (z * a - x * c), s * (x * b - y * a)
            a, b, c = a - w * i + y * k - z * j, b - w * j + z * i - x * k, c - w * k + x * j - y * i
            m = body.inertia_kg_m2
            xx, xy, xz, yy, yz, zz = m[0, 0], m[0, 1], m[0, 2], m[1, 1], m[1, 2], m[2, 2]
            i, j, k = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy  # cofactors
            det = xx * i + xy * j + xz * k
            if det != 0:  # PyBullet's point masses do not turn
                turn = a * a * i + b * b * (xx * zz - xz * xz) + c * c * (xx * yy - xy * xy)
                mobility += (turn + 2 * (a * b * j + a * c * k + b * c * (xy * xz - xx * yz))) / det
    return 1 / mobility if mobility > 0 else 0.0


@njit(nogil=True, error_model="numpy")
def flat_area_m2(bodies, low, high, spread_m, curvature_per_m, least_share):
    """Compute the area of a flat contact of two bodies, 0 where it is curved: the disc with the points' spread.

    spread_m: root of Σ w·|p - Σ w·p|² of the points p under loads w of sum 1. least_share: of the smaller body's size,
    least radius of a flat contact.
    """
    size = np.inf
    for side in range(2):
        body = bodies[low] if side == 0 else bodies[high]
        if body.volume_m3 > 0:
            size = min(size, body.size_m)
    if size == np.inf:
        size = SIZELESS_M
    if curvature_per_m * size > FLAT_CURVATURE:
        return 0.0
    radius = max(spread_m, least_share * size)
    return np.pi * (radius * radius)
