"""Speed of a contact over either surface.

    u_b - u_a = v_a - v_b = slip                 u: velocity of the contact relative to a body's material (exact)
    u_a ≈ ½ (d_a + d_b - slip), u_b = u_a + slip

d_a, d_b: displacement of the contact in either body's frame since the same contact was last seen, over the time between
[the frames of Montana 1988, The kinematics of contact and grasp, eq. 20-24, by differences instead of curvatures].
PyBullet does not identify contacts from step to step, and a resting box shows one to four of its corners at a time, in
turn. A contact is therefore matched to the nearest earlier one of its pair among the last MEMORY_STEPS steps. Without
slip a contact travels no faster than |ω_rel|·R: a match is refused if it moves faster than that over both surfaces at
once. Without a match the pair keeps its last velocity; a new pair's contact stays on the smaller body.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.listener.kinematics import pose_after, turn
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

MEMORY_STEPS = 5

TRACE = np.dtype(
    [
        ("time_s", "f8"),
        ("point_a_m", "f8", (3,)),
        ("point_b_m", "f8", (3,)),
        ("u_a_m_s", "f8", (3,)),  # in the world's axes
        ("pair", "i8"),  # the j-th entry: pair and row of the j-th contact in the order of pairs
        ("order", "i8"),
    ],
    align=True,
)
"""A contact of one step, and its place in the order of pairs."""


class TraceTables(NamedTuple):
    """`Traces` as kernels take them."""

    table: Array
    contacts: Array
    newest: int
    work: Array


class Traces:
    """Contacts of the last MEMORY_STEPS steps, in a ring of one table more.

    Attributes
    ----------
    table : Array of TRACE, shape (MEMORY_STEPS + 1, capacity)
    count
        Contacts of each table.
    newest
        Table of the coming step.
    work : Array, shape (1,)
        Work space of a contact: poses of both bodies at its sub-step, and its slip.
    """

    def __init__(self) -> None:
        scratch = np.dtype([("x", "f8", (2, 3)), ("q", "f8", (2, 4)), ("slip", "f8", (3,))], align=True)
        self.table: Array = np.zeros((MEMORY_STEPS + 1, 0), TRACE)
        self.count = np.zeros(MEMORY_STEPS + 1, np.int64)
        self.newest = 0
        self.work = np.zeros(1, scratch)

    def clear(self) -> None:
        """Forget all contacts."""
        self.count[:] = 0

    def reserve(self, rows: int) -> None:
        """Make space for that many contacts in a step."""
        if rows > self.table.shape[1]:
            grown = np.zeros((len(self.table), 2 * rows), TRACE)
            grown[:, : self.table.shape[1]] = self.table
            self.table = grown

    def turn(self) -> None:
        """Advance the ring by a step; the oldest table is reused."""
        self.newest = (self.newest - 1) % len(self.count)


@njit(nogil=True, error_model="numpy")
def surface_velocity(dx, dy, dz, age, q, normal):
    """Return the velocity, world axes, of a contact displaced by (dx, dy, dz) in the frame of a body of orientation q.

    The displacement is rotated into the tangent plane at full length: the chord of a rolling step leaves the plane by
    half the angle rolled; its length, not its projection, is the path.
    """
    dx, dy, dz = turn(q[0], q[1], q[2], q[3], dx, dy, dz)
    length2 = dx * dx + dy * dy + dz * dz
    along = dx * normal[0] + dy * normal[1] + dz * normal[2]
    dx, dy, dz = dx - along * normal[0], dy - along * normal[1], dz - along * normal[2]
    flat2 = dx * dx + dy * dy + dz * dz
    scale = np.sqrt(length2 / flat2) / age if flat2 > 0.25 * length2 else 1.0 / age
    return dx * scale, dy * scale, dz * scale


@njit(nogil=True, error_model="numpy")
def slower(x, y, z, slip):
    """Return the smaller of |u_a| and |u_b|, u_a = (x, y, z)."""
    a = x * x + y * y + z * z
    b = (x + slip[0]) ** 2 + (y + slip[1]) ** 2 + (z + slip[2]) ** 2
    return np.sqrt(min(a, b))


@njit(nogil=True, error_model="numpy")
def first_of(table, count, pair):
    """Find the first of `count` entries, in the order of pairs, that is not before `pair`."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if table[middle].pair < pair:
            low = middle + 1
        else:
            high = middle
    return low


@njit(nogil=True, error_model="numpy")
def recognise(fresh, pair, traces, work, normal, limit):
    """Fill u_a of a TRACE row whose time and points are set; False where no earlier contact of the pair matches.

    limit: largest speed of the slower sweep, m/s.
    """
    best, held = np.inf, False
    table, count, newest = traces.table, traces.contacts, traces.newest
    slip, u = work.slip, fresh.u_a_m_s
    for step in range(1, MEMORY_STEPS + 1):
        trace, known = table[(newest + step) % (MEMORY_STEPS + 1)], count[(newest + step) % (MEMORY_STEPS + 1)]
        for j in range(first_of(trace, known, pair), known):
            if trace[j].pair != pair:
                break
            old = trace[trace[j].order]
            if not held:
                for x in range(3):
                    u[x] = old.u_a_m_s[x]
                held = True
            age = fresh.time_s - old.time_s
            if fresh.time_s <= old.time_s:
                continue
            p, q, r, s = fresh.point_a_m, old.point_a_m, fresh.point_b_m, old.point_b_m
            ax, ay, az = surface_velocity(p[0] - q[0], p[1] - q[1], p[2] - q[2], age, work.q[0], normal)
            bx, by, bz = surface_velocity(r[0] - s[0], r[1] - s[1], r[2] - s[2], age, work.q[1], normal)
            ux, uy, uz = 0.5 * (ax + bx - slip[0]), 0.5 * (ay + by - slip[1]), 0.5 * (az + bz - slip[2])
            speed = slower(ux, uy, uz, slip)
            if speed <= limit and speed < best:
                best = speed
                u[0], u[1], u[2] = ux, uy, uz
        if best < np.inf:
            return True
    return held and slower(u[0], u[1], u[2], slip) <= limit


@njit(nogil=True, error_model="numpy")
def place(touch, a, b, work, fresh):
    """Fill the points of a TRACE row: a contact in the frames of both bodies, by their poses when it was loaded.

    Returns the distances from both centres, m; both poses are written to `work`.
    """
    pose_after(a, touch.elapsed_s, work.x[0], work.q[0])
    pose_after(b, touch.elapsed_s, work.x[1], work.q[1])
    p, q, x = touch.point_a_m, work.q[0], work.x[0]
    ax, ay, az = turn(-q[0], -q[1], -q[2], q[3], p[0] - x[0], p[1] - x[1], p[2] - x[2])
    p, q, x = touch.point_b_m, work.q[1], work.x[1]
    bx, by, bz = turn(-q[0], -q[1], -q[2], q[3], p[0] - x[0], p[1] - x[1], p[2] - x[2])
    fresh.point_a_m[0], fresh.point_a_m[1], fresh.point_a_m[2] = ax, ay, az
    fresh.point_b_m[0], fresh.point_b_m[1], fresh.point_b_m[2] = bx, by, bz
    return np.sqrt(ax**2 + ay**2 + az**2), np.sqrt(bx**2 + by**2 + bz**2)


@njit(nogil=True, error_model="numpy")
def sweep(touch, a, b, pair, traces, work, fresh, speed):
    """Write the speeds (2,) in m/s of a contact over the bodies a and b (START rows), and its TRACE row `fresh`.

    traces: TraceTables. work: with the slip; the time of `fresh` is set. The distant centre of a static body
    says nothing of its size.
    """
    roll_margin, slip_margin = 2.0, 0.05
    far_a, far_b = place(touch, a, b, work, fresh)
    v, w, slip, u = a.spin_rad_s, b.spin_rad_s, work.slip, fresh.u_a_m_s
    rolled = np.sqrt((v[0] - w[0]) ** 2 + (v[1] - w[1]) ** 2 + (v[2] - w[2]) ** 2)
    reach = max(0.0 if a.static else far_a, 0.0 if b.static else far_b)
    limit = roll_margin * rolled * reach + slip_margin * np.sqrt(
        slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]
    )
    if not recognise(fresh, pair, traces, work, touch.normal, limit):
        share = 0.0 if not a.static and (b.static or far_a <= far_b) else -1.0
        for x in range(3):
            u[x] = share * slip[x]
    speed[0] = np.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    speed[1] = np.sqrt((u[0] + slip[0]) ** 2 + (u[1] + slip[1]) ** 2 + (u[2] + slip[2]) ** 2)


@njit(nogil=True, error_model="numpy")
def sort_pairs(row, count, trace):
    """Write pair and order of the first `count` entries of a trace: CONTACT rows by (a, b), stable.

    Merge sort from the bottom: runs of 1, 2, 4 … are joined, alternating between two buffers.
    """
    key, order = np.empty((2, count), np.int64), np.empty((2, count), np.int64)
    for i in range(count):
        key[0, i], order[0, i] = np.int64(row[i].a) << 32 | np.int64(row[i].b), i
    source, width = 0, 1
    while width < count:
        target = 1 - source
        for low in range(0, count, 2 * width):
            middle, high = min(low + width, count), min(low + 2 * width, count)
            i, j = low, middle
            for n in range(low, high):
                if i < middle and (j >= high or key[source, i] <= key[source, j]):
                    key[target, n], order[target, n] = key[source, i], order[source, i]
                    i += 1
                else:
                    key[target, n], order[target, n] = key[source, j], order[source, j]
                    j += 1
        source, width = target, 2 * width
    for i in range(count):
        trace[i].pair, trace[i].order = key[source, i], order[source, i]
