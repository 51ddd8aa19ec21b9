"""Contact rows of one step: which contacts count, and what the synthesis needs of each.

    TOUCH (k,) + START (n,) -> CONTACT rows, traces for the next step, poses of the bodies in the log

Compiled; `take_step` makes a whole step in one call where no case is unusual.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.listener.kinematics import relative_motion
from sonic_bullet.listener.polling import all_usable, load
from sonic_bullet.listener.start import LEFT_OUT, begin
from sonic_bullet.listener.sweep import TraceTables, sort_pairs, sweep
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records.arrays import LARGEST_SI


class _NoRows(NamedTuple):
    """In place of a number of rows."""

    unknown: int = -1  # a contact of a link that is not in the roster
    strangers: int = -2  # links in their first contact (START.met)
    absurd: int = -3  # a number beyond `LARGEST_SI`
    unusual: int = -4  # a case that Python has to handle (`take_step`)


NO_ROWS = _NoRows()


@njit(nogil=True, error_model="numpy")
def find(start, code):
    """Find the row of a code in START (n,), or -1."""
    low, high = 0, len(start)
    while low < high:
        middle = (low + high) // 2
        if start[middle].code < code:
            low = middle + 1
        else:
            high = middle
    return low if low < len(start) and start[low].code == code else -1


@njit(nogil=True, error_model="numpy")
def still(body):
    """Tell whether every speed is exactly 0."""
    v, w = body.velocity_m_s, body.spin_rad_s
    return v[0] == 0 and v[1] == 0 and v[2] == 0 and w[0] == 0 and w[1] == 0 and w[2] == 0


@njit(nogil=True, error_model="numpy")
def seen(touch, i, past):
    """Tell whether contact i is one of `past`, to the bit."""
    row, k = touch[i], len(past)
    p, j = row.point_a_m, row.impulse_n_s
    for n in range(k):
        old = past[(i + n) % k]
        q, h = old.point_a_m, old.impulse_n_s
        if (
            q[0] == p[0]
            and q[1] == p[1]
            and q[2] == p[2]
            and h[0] == j[0]
            and h[1] == j[1]
            and h[2] == j[2]
            and old.code_a == row.code_a
            and old.code_b == row.code_b
        ):
            return True
    return False


@njit(nogil=True, error_model="numpy")
def counts(touch, i, past, a, b, approach, dt):
    """Tell whether a contact of the links a, b (START rows) counts.

    It does not where it is asleep, where a body was moved by hand, or where a body in its first step is deeper inside
    its partner than its speed explains. past: contacts of the step before.
    """
    spawn_depth_m = 1e-4
    if a.moved or b.moved:
        return False
    if still(a) and still(b) and seen(touch, i, past):
        return False
    inside = touch[i].gap_m < -(spawn_depth_m + max(approach, 0.0) * dt)
    return not (inside and (a.born or b.born))


@njit(nogil=True, error_model="numpy")
def fill(row, touch, fresh, slip, approach):
    """Fill a CONTACT row except its bodies and sweep; return whether all numbers are within `LARGEST`."""
    row.approach_m_s = approach
    row.gap_m = touch.gap_m + max(approach, 0.0) * touch.elapsed_s
    fine = abs(approach) <= LARGEST_SI and abs(row.gap_m) <= LARGEST_SI  # False for NaN too
    fine = fine and abs(row.sweep_m_s[0]) <= LARGEST_SI and abs(row.sweep_m_s[1]) <= LARGEST_SI
    for x in range(3):
        row.point_a_m[x], row.point_b_m[x] = fresh.point_a_m[x], fresh.point_b_m[x]
        row.normal[x], row.impulse_n_s[x], row.slip_m_s[x] = touch.normal[x], touch.impulse_n_s[x], slip[x]
        fine = fine and abs(fresh.point_a_m[x]) <= LARGEST_SI and abs(fresh.point_b_m[x]) <= LARGEST_SI
        fine = fine and abs(slip[x]) <= LARGEST_SI
    return fine


@njit(nogil=True, error_model="numpy")
def contact_rows(touch, count, past, start, dt, time, traces, row):
    """Fill row (k,) of CONTACT and the newest trace.

    Parameters
    ----------
    touch, count
        `count` rows of TOUCH.
    past
        Those of the step before.
    start : Array of START, shape (n,)
    dt, time
        Length and start of the step in s.
    traces : TraceTables
        With space for `count`.

    Returns
    -------
    int
        Number of rows, or one of `NO_ROWS`.
    """
    made, strangers, fine, work = np.int64(0), False, True, traces.work[0]  # a literal 0 would compile sort_pairs twice
    trace = traces.table[traces.newest]
    for i in range(count):
        one = touch[i]
        at_a, at_b = find(start, one.code_a), find(start, one.code_b)
        if at_a < 0 or at_b < 0:
            return NO_ROWS.unknown
        a, b = start[at_a], start[at_b]
        approach = relative_motion(one, a, b, work.slip)
        if not counts(touch, i, past, a, b, approach, dt):
            continue
        if a.index < 0 or b.index < 0:
            if min(a.index, b.index) > LEFT_OUT:
                a.met, b.met, strangers = a.index < 0, b.index < 0, True
            continue
        fresh, out = trace[made], row[made]
        fresh.time_s = time + one.elapsed_s
        out.a, out.b = a.index, b.index
        sweep(one, a, b, a.index << 32 | b.index, traces, work, fresh, out.sweep_m_s)
        fine = fill(out, one, fresh, work.slip, approach) and fine
        made += 1
    if strangers:
        return NO_ROWS.strangers
    if not fine:
        return NO_ROWS.absurd
    sort_pairs(row, made, trace)
    traces.contacts[traces.newest] = made
    return made


@njit(nogil=True, error_model="numpy")
def place_bodies(start, position, quaternion, teleported):
    """Write the poses of START rows (n,) that have an index, each to its row START.pose.

    position (b, 3), quaternion (b, 4), teleported (b,): moved by hand.
    """
    for i in range(len(start)):
        body = start[i]
        if body.index >= 0:
            for x in range(3):
                position[body.pose, x] = body.position_m[x]
            for x in range(4):
                quaternion[body.pose, x] = body.quaternion_xyzw[x]
            teleported[body.pose] = body.moved != 0


@njit(nogil=True, error_model="numpy")
def unmoved(earlier, later):
    """Tell whether every number of two MOTION tables is the same."""
    for i in range(len(later)):
        a, b = earlier[i], later[i]
        for x in range(3):
            if a.position_m[x] != b.position_m[x] or a.velocity_m_s[x] != b.velocity_m_s[x]:
                return False
            if a.spin_rad_s[x] != b.spin_rad_s[x]:
                return False
        for x in range(4):
            if a.quaternion_xyzw[x] != b.quaternion_xyzw[x]:
                return False
    return True


@njit(nogil=True, error_model="numpy")
def take_step(  # noqa: PLR0917  called from Python, where groups would cost more than the step
    raw,
    before,
    touch,
    past,
    earlier,
    later,
    by_hand,
    hooked,
    start,
    dt,
    time,
    table,
    counted,
    newest,
    scratch,
    row,
    position,
    quaternion,
    teleported,
):
    """Make a step of an unchanged roster; return how many contacts and rows it has, or why it has none.

    raw, before (k,) of RAW: polled after this step and the last. touch (k,) of TOUCH, start (n,) of START, row (k,) of
    CONTACT, position, quaternion, teleported: filled. The rest: see `begin`, `contact_rows`, `place_bodies`. Unusual:
    a number is NaN or too large or, without hooks, a body was moved by hand or the step changed nothing; the others of
    `NO_ROWS`: see there. The state that outlives the step is not changed then.
    """
    count = load(raw, before, dt, touch)
    if not all_usable(touch, count) or (not hooked and unmoved(earlier, later)):
        return count, NO_ROWS.unusual
    moved = begin(earlier, later, dt, by_hand, hooked, start)
    if moved and not hooked:
        return count, NO_ROWS.unusual
    made = contact_rows(touch, count, past, start, dt, time, TraceTables(table, counted, newest, scratch), row)
    if made >= 0:
        place_bodies(start, position, quaternion, teleported)
    return count, made
