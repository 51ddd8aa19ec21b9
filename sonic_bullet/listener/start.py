"""Poses and twists at the start of a step, and which bodies were moved by hand or are new.

    MOTION rows before and after -> `begin` -> START rows

With hooks they were read before the step. Otherwise those left by the step before hold, except for bodies that are new
or were moved since: there the simulator's own step is undone (`Undo`). A semi-implicit integrator has
x(n+1) = x(n) + v(n+1)·dt, so a pose that jumps farther than its speeds allow was moved by hand. A body of mass 0 may be
driven by resetting its pose each step: up to 10 m/s that is motion, and the body has the velocity of that
move; above it, it is a jump.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from sonic_bullet.listener.frames import LINK_SPAN, LINK_STATE, Motion, Roster, rows_of
from sonic_bullet.listener.kinematics import rotation_between
from sonic_bullet.listener.polling import Touches
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

START = np.dtype(
    [
        *((name, LINK_STATE[name]) for name in LINK_STATE.names or ()),
        ("code", "i8"),  # frames.encode
        ("static", "i8"),  # 1 where its mass is 0
        ("index", "i8"),  # into the bodies of the log; -1 without a contact yet, LEFT_OUT
        ("pose", "i8"),  # where index is not below 0: its row among the step's poses
        ("moved", "i8"),  # 1 where it was set elsewhere by hand since the step before
        ("born", "i8"),  # 1 in its first step
        ("met", "i8"),  # 1 in its first contact
    ],
    align=True,
)
"""A link at the start of a step; rows as a roster's, ascending in code."""

LEFT_OUT = -2
"""Index of a link whose contacts are dropped."""

NOBODY = np.zeros(0, np.int64)

Undo = Callable[[Motion, Array, Touches, float], Motion]
"""(motion after the step, rows (n,) to undo, the step's contacts, its length) -> the motion one step earlier,
right in those rows.
"""


def start_table(roster: Roster) -> Array:
    """Make START rows (n,) of a roster with code and static filled and no body known."""
    table = np.zeros(len(roster.code), START)
    table["code"], table["static"], table["index"] = roster.code, roster.static, -1
    return table


@njit(nogil=True, error_model="numpy")
def jump(earlier, later, static, dt):
    """Tell whether a link moved farther than 1.5 × both speeds (static: 10 m/s) explain."""
    driven_speed_m_s, jump_floor_m = 10.0, 1e-3
    moved, v, w = 0.0, 0.0, 0.0
    for x in range(3):
        moved += (later.position_m[x] - earlier.position_m[x]) ** 2
        v += later.velocity_m_s[x] ** 2
        w += earlier.velocity_m_s[x] ** 2
    reach = driven_speed_m_s if static else 1.5 * (np.sqrt(v) + np.sqrt(w))
    return np.sqrt(moved) > reach * dt + jump_floor_m


@njit(nogil=True, error_model="numpy")
def drive(earlier, later, dt, body):
    """Give a link of mass 0 whose pose was reset since `earlier` the velocity of that move."""
    p, q, x, y = earlier.position_m, earlier.quaternion_xyzw, later.position_m, later.quaternion_xyzw
    if (
        p[0] == x[0]
        and p[1] == x[1]
        and p[2] == x[2]
        and q[0] == y[0]
        and q[1] == y[1]
        and q[2] == y[2]
        and q[3] == y[3]
    ):
        return
    rotation_between(q, y, body.spin_rad_s)
    for i in range(3):
        body.velocity_m_s[i] = (x[i] - p[i]) / dt
        body.spin_rad_s[i] /= dt


@njit(nogil=True, error_model="numpy")
def begin(earlier, later, dt, by_hand, hooked, start):
    """Fill start (n,) of START for a step of length dt; return how many were moved.

    earlier, later (n,) of MOTION: with hooks, read before the step before and before this one; else after those.
    by_hand (h,): ids of bodies known to be moved. The roster is unchanged, so no body is new.
    """
    count = 0
    for i in range(len(start)):
        body, now = start[i], later[i]
        static = body.static != 0
        moved = jump(earlier[i], now, static, dt)
        if not static:
            for j in range(len(by_hand)):
                moved = moved or by_hand[j] == body.code // LINK_SPAN
        at = now if hooked or static else earlier[i]
        for x in range(3):
            body.position_m[x], body.velocity_m_s[x] = at.position_m[x], at.velocity_m_s[x]
            body.spin_rad_s[x] = at.spin_rad_s[x]
        for x in range(4):
            body.quaternion_xyzw[x] = at.quaternion_xyzw[x]
        if static:
            drive(earlier[i], now, dt, body)
        body.moved, body.born, body.met = moved, 0, 0
        count += moved
    return count


def hooked_start(past: Motion | None, now: Motion, by_hand: Collection[int], dt_s: float) -> Array:
    """Make START rows (n,) from motions read before steps.

    Parameters
    ----------
    past, now
        Read before the last step (None: no step yet) and before this one.
    by_hand
        Bodies known to be moved.
    dt_s
        Length of the step.
    """
    start = start_table(now.roster)
    if past is None:
        set_motion(start, now.row, slice(None))
        start["born"] = 1
        return start
    old = rows_of(past.roster, now.roster.code)
    begin(_earlier(past, now, old), now.row, dt_s, np.array(sorted(by_hand), np.int64), True, start)
    if past.roster is not now.roster:  # the id may have been reused
        set_motion(start, now.row, now.roster.static)
    start["born"] = old < 0
    start["moved"][old < 0] = 0
    return start


def polled_start(past: Motion, now: Motion, touches: Touches, dt_s: float, *, undo: Undo, first: bool) -> Array:
    """Make START rows (n,) from the motions read after the last step and after this one.

    A body that is static by mass 0 starts at its pose of now.

    undo: undoes a step where no pose was read before it.
    """
    start, old = start_table(now.roster), rows_of(past.roster, now.roster.code)
    begin(_earlier(past, now, old), now.row, dt_s, NOBODY, False, start)
    if past.roster is not now.roster:
        set_motion(start, now.row, now.roster.static)
    start["moved"][old < 0] = 0
    lost = (old < 0) | (start["moved"] != 0)
    if lost.any():
        set_motion(start, now.row, lost & now.roster.static)
        set_motion(start, undo(now, lost, touches, dt_s).row, lost & ~now.roster.static)
    start["born"] = old < 0
    if first:
        start["born"], start["moved"] = 1, 0
    return start


def set_motion(start: Array, row: Array, mask: Array | slice) -> None:
    """Copy poses and twists of row (n,) of MOTION to START rows where mask (n,) is True."""
    for name in LINK_STATE.names or ():
        start[name][mask] = row[name][mask]


def jumped(past: Motion, now: Motion, dt_s: float) -> Array:
    """Mark the links (n,) of `now` that one step moved farther than both speeds explain, so by hand; new ones never."""
    start, old = start_table(now.roster), rows_of(past.roster, now.roster.code)
    begin(_earlier(past, now, old), now.row, dt_s, NOBODY, True, start)
    return np.asarray((start["moved"] != 0) & (old >= 0))


def _earlier(past: Motion, now: Motion, old: Array) -> Array:
    """Return MOTION rows (n,) of `past` in the order of `now`; a new link has its pose of now."""
    row, known = now.row.copy(), old >= 0
    row[known] = past.row[old[known]]
    return row
