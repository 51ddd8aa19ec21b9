"""How fast a contact moves over either surface.

    u_b - u_a = v_a - v_b = slip                 u: velocity of the contact relative to a body's material (exact)
    u_a ≈ ½ (d_a + d_b - slip), u_b = u_a + slip

d_a, d_b: displacement of the contact in either body's frame since the same contact was last seen, over the time between
[the frames of Montana 1988, The kinematics of contact and grasp, eq. 20-24, by differences instead of curvatures].
PyBullet names no contact from step to step, and a resting box shows one to four of its corners at a time, in turn: a
contact is recognised as the nearest earlier one of its pair among the last MEMORY_STEPS steps. Without slip a contact
travels no faster than |ω_rel|·R: a match is refused if it moves faster than that over both surfaces at once. Without a
match the pair keeps its last velocity; a new pair's contact stays on the smaller body.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.listener.kinematics import Table, pose_after, turn
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

MEMORY_STEPS = 5
ROLL_MARGIN = 2.0
SLIP_MARGIN = 0.05

Trace = tuple[Array, Array]
"""Contacts of one step, ordered by pair: pair (k,) int64; (k, 10) of time_s, point_a_m (3), point_b_m (3), u_a (3) in
the world's axes.
"""

NO_TRACE: Trace = (np.zeros(0, np.int64), np.zeros((0, 10)))
NO_TRACES = (NO_TRACE,) * MEMORY_STEPS


@njit(fastmath=False, nogil=True, inline="always")
def surface_velocity(
    rows: Array, i: int, old: Array, j: int, first: int, quaternion: Array, normal: Array
) -> tuple[float, float, float]:
    """Velocity of a contact over a surface, world axes: from row j of `old` to row i of `rows`, point in columns first
    … first + 2.

    Laid into the tangent plane at full length: the chord of a rolling step leaves the plane by half the angle rolled;
    its length, not its projection, is the path.
    """
    q = quaternion
    dx, dy, dz = turn(
        q[0],
        q[1],
        q[2],
        q[3],
        rows[i, first] - old[j, first],
        rows[i, first + 1] - old[j, first + 1],
        rows[i, first + 2] - old[j, first + 2],
    )
    length2 = dx * dx + dy * dy + dz * dz
    along = dx * normal[i, 0] + dy * normal[i, 1] + dz * normal[i, 2]
    dx, dy, dz = dx - along * normal[i, 0], dy - along * normal[i, 1], dz - along * normal[i, 2]
    flat2 = dx * dx + dy * dy + dz * dz
    age = rows[i, 0] - old[j, 0]
    scale = np.sqrt(length2 / flat2) / age if flat2 > 0.25 * length2 else 1.0 / age
    return dx * scale, dy * scale, dz * scale


@njit(fastmath=False, nogil=True, inline="always")
def slower(x: float, y: float, z: float, slip: Array, i: int) -> float:
    """The smaller of |u_a| and |u_b|, u_a = (x, y, z)."""
    a = x * x + y * y + z * z
    b = (x + slip[i, 0]) ** 2 + (y + slip[i, 1]) ** 2 + (z + slip[i, 2]) ** 2
    return float(np.sqrt(min(a, b)))


@njit(fastmath=False, nogil=True)
def recognise(
    rows: Array,
    i: int,
    pair: int,
    traces: tuple[Trace, ...],
    quat_a: Array,
    quat_b: Array,
    normal: Array,
    slip: Array,
    limit: float,
) -> bool:
    """Fill u_a (columns 7-9) of row i, whose time and points stand already; False where nothing of the pair is known
    that fits.

    limit: how slow the slower sweep must be, m/s.
    """
    best, held = np.inf, False
    for old_pair, old in traces:
        for j in range(np.searchsorted(old_pair, pair), len(old_pair)):
            if old_pair[j] != pair:
                break
            if not held:
                rows[i, 7], rows[i, 8], rows[i, 9] = old[j, 7], old[j, 8], old[j, 9]
                held = True
            if rows[i, 0] <= old[j, 0]:
                continue
            ax, ay, az = surface_velocity(rows, i, old, j, 1, quat_a, normal)
            bx, by, bz = surface_velocity(rows, i, old, j, 4, quat_b, normal)
            ux, uy, uz = 0.5 * (ax + bx - slip[i, 0]), 0.5 * (ay + by - slip[i, 1]), 0.5 * (az + bz - slip[i, 2])
            speed = slower(ux, uy, uz, slip, i)
            if speed <= limit and speed < best:
                best = speed
                rows[i, 7], rows[i, 8], rows[i, 9] = ux, uy, uz
        if best < np.inf:
            return True
    return held and slower(rows[i, 7], rows[i, 8], rows[i, 9], slip, i) <= limit


@njit(fastmath=False, nogil=True)
def place_and_match(
    traces: tuple[Trace, ...],
    pair: Array,
    time: Array,
    elapsed: Array,
    point_a: Array,
    point_b: Array,
    normal: Array,
    slip: Array,
    table: Table,
    static: Array,
    row_a: Array,
    row_b: Array,
) -> tuple[Array, Array]:
    """New trace rows (k, 10) in the order given, and sweep speeds (k, 2) in m/s.

    pair, time, elapsed (k,): elapsed since the start of the step, at which `table` and the rows row_a, row_b (k,) of it
    hold. point_a, point_b, normal, slip (k, 3): world frame. static (n,): bodies that cannot move, whose far-off
    centres say nothing of size.
    """
    rows, speed = np.empty((len(pair), 10)), np.empty((len(pair), 2))
    xa, xb, qa, qb, spin = np.empty(3), np.empty(3), np.empty(4), np.empty(4), table[3]
    for i in range(len(pair)):
        a, b = row_a[i], row_b[i]
        pose_after(table, a, elapsed[i], xa, qa)
        pose_after(table, b, elapsed[i], xb, qb)
        rows[i, 0] = time[i]
        rows[i, 1], rows[i, 2], rows[i, 3] = turn(
            -qa[0], -qa[1], -qa[2], qa[3], point_a[i, 0] - xa[0], point_a[i, 1] - xa[1], point_a[i, 2] - xa[2]
        )
        rows[i, 4], rows[i, 5], rows[i, 6] = turn(
            -qb[0], -qb[1], -qb[2], qb[3], point_b[i, 0] - xb[0], point_b[i, 1] - xb[1], point_b[i, 2] - xb[2]
        )
        far_a = np.sqrt(rows[i, 1] ** 2 + rows[i, 2] ** 2 + rows[i, 3] ** 2)
        far_b = np.sqrt(rows[i, 4] ** 2 + rows[i, 5] ** 2 + rows[i, 6] ** 2)
        rolled = np.sqrt(
            (spin[a, 0] - spin[b, 0]) ** 2 + (spin[a, 1] - spin[b, 1]) ** 2 + (spin[a, 2] - spin[b, 2]) ** 2
        )
        sx, sy, sz = slip[i, 0], slip[i, 1], slip[i, 2]
        reach = max(0.0 if static[a] else far_a, 0.0 if static[b] else far_b)
        limit = ROLL_MARGIN * rolled * reach + SLIP_MARGIN * np.sqrt(sx * sx + sy * sy + sz * sz)
        if not recognise(rows, i, pair[i], traces, qa, qb, normal, slip, limit):
            share = 0.0 if not static[a] and (static[b] or far_a <= far_b) else -1.0
            rows[i, 7], rows[i, 8], rows[i, 9] = share * sx, share * sy, share * sz
        ux, uy, uz = rows[i, 7], rows[i, 8], rows[i, 9]
        speed[i, 0] = np.sqrt(ux * ux + uy * uy + uz * uz)
        speed[i, 1] = np.sqrt((ux + sx) ** 2 + (uy + sy) ** 2 + (uz + sz) ** 2)
    return rows, speed


def remembered(traces: tuple[Trace, ...], pair: Array, rows: Array) -> tuple[Trace, ...]:
    """MEMORY_STEPS traces with the newest step in front, rows ordered by pair, and the oldest forgotten."""
    order = np.argsort(pair, kind="stable")
    return ((pair[order], rows[order]), *traces[: MEMORY_STEPS - 1])
