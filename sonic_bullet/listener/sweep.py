"""How fast a contact moves over either surface.

    u_b - u_a = v_a - v_b = slip                 u: velocity of the contact relative to a body's material (exact)
    u_a ≈ ½ (d_a + d_b - slip), u_b = u_a + slip

d_a, d_b: displacement of the contact in either body's frame since the same contact was last seen, over the time between
[the frames of Montana 1988, The kinematics of contact and grasp, eq. 20-24, by differences instead of curvatures].
PyBullet names no contact from step to step, and a resting box shows one to four of its corners at a time, in turn: a contact
is recognised as the nearest earlier one of its pair among the last MEMORY_STEPS steps. Without slip a contact travels no
faster than |ω_rel|·R: a match is refused if it moves faster than that over both surfaces at once. Without a match the
pair keeps its last velocity; a new pair's contact stays on the smaller body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from sonic_bullet.listener.kinematics import turn
from sonic_bullet.records import Array

MEMORY_STEPS = 8
ROLL_MARGIN = 2.0
SLIP_MARGIN = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Contacts of one step, ordered by pair: pair (k,) int64, time_s (k,), point_a_m, point_b_m (k, 3), over_a_m_s (k, 3) = u_a, world frame."""

    pair: Array
    time_s: Array
    point_a_m: Array
    point_b_m: Array
    over_a_m_s: Array


@njit(cache=True, fastmath=False, nogil=True)  # type: ignore[untyped-decorator]
def match(  # noqa: PLR0912, PLR0917
    traces: tuple[Array, Array, Array, Array, Array],
    starts: Array,
    pair: Array,
    time: Array,
    point_a: Array,
    point_b: Array,
    quat_a: Array,
    quat_b: Array,
    normal: Array,
    slip: Array,
    roll: Array,
    settle_a: Array,
) -> Array:
    """u_a (k, 3) in m/s. traces: columns of Trace, newest step first, step s in rows starts[s] … starts[s+1]-1.

    roll (k,) = |ω_rel|·R in m/s. settle_a (k,): where nothing is known, a's point stays and b is swept (else the other way).
    """
    old_pair, old_time, old_a, old_b, old_u = traces
    result = np.zeros((len(pair), 3))
    for i in range(len(pair)):
        slipping = np.sqrt(slip[i, 0] ** 2 + slip[i, 1] ** 2 + slip[i, 2] ** 2)
        limit = ROLL_MARGIN * roll[i] + SLIP_MARGIN * slipping
        found, held = False, False
        for s in range(len(starts) - 1):
            first = starts[s] + np.searchsorted(old_pair[starts[s] : starts[s + 1]], pair[i])
            best = np.inf
            for j in range(first, starts[s + 1]):
                if old_pair[j] != pair[i]:
                    break
                if not held:
                    result[i] = old_u[j]
                    held = True
                age = time[i] - old_time[j]
                if age <= 0:
                    continue
                a = surface_velocity(point_a[i], old_a[j], quat_a[i], normal[i], age)
                b = surface_velocity(point_b[i], old_b[j], quat_b[i], normal[i], age)
                over_a = np.empty(3)
                fast_a, fast_b = 0.0, 0.0
                for x in range(3):
                    over_a[x] = 0.5 * (a[x] + b[x] - slip[i, x])
                    fast_a += over_a[x] ** 2
                    fast_b += (over_a[x] + slip[i, x]) ** 2
                slower = np.sqrt(min(fast_a, fast_b))
                if slower <= limit and slower < best:
                    best = slower
                    result[i] = over_a
                    found = True
            if found:
                break
        if not found:
            fast_a, fast_b = 0.0, 0.0
            for x in range(3):
                fast_a += result[i, x] ** 2
                fast_b += (result[i, x] + slip[i, x]) ** 2
            if not held or np.sqrt(min(fast_a, fast_b)) > limit:
                for x in range(3):
                    result[i, x] = 0.0 if settle_a[i] else -slip[i, x]
    return result


@njit(cache=True, fastmath=False, nogil=True, inline="always")  # type: ignore[untyped-decorator]
def surface_velocity(now: Array, before: Array, quaternion: Array, normal: Array, age: float) -> tuple[float, float, float]:
    """Displacement in a body's frame over time, in the world's axes, laid into the tangent plane at full length.

    The chord of a rolling step leaves the tangent plane by half the angle rolled; its length, not its projection, is the path.
    """
    q = quaternion
    dx, dy, dz = turn(q[0], q[1], q[2], q[3], now[0] - before[0], now[1] - before[1], now[2] - before[2])
    length2 = dx * dx + dy * dy + dz * dz
    along = dx * normal[0] + dy * normal[1] + dz * normal[2]
    dx, dy, dz = dx - along * normal[0], dy - along * normal[1], dz - along * normal[2]
    flat2 = dx * dx + dy * dy + dz * dz
    scale = np.sqrt(length2 / flat2) / age if flat2 > 0.25 * length2 else 1.0 / age
    return dx * scale, dy * scale, dz * scale


def stacked(traces: tuple[Trace, ...]) -> tuple[tuple[Array, Array, Array, Array, Array], Array]:
    """The columns of all traces one after the other, and where each begins (s + 1,)."""
    starts = np.concatenate([[0], np.cumsum([len(trace.pair) for trace in traces])]).astype(np.int64)
    if not traces:
        return (np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))), starts
    pair, time, a, b, u = (np.concatenate([getattr(trace, name) for trace in traces]) for name in Trace.__slots__)
    return (pair, time, a, b, u), starts


def remembered(traces: tuple[Trace, ...], trace: Trace) -> tuple[Trace, ...]:
    """Traces with the newest step in front, rows ordered by pair, and what is too old forgotten."""
    order = np.argsort(trace.pair, kind="stable")
    return (Trace(*(getattr(trace, name)[order] for name in Trace.__slots__)), *traces[: MEMORY_STEPS - 1])
