"""Poses and twists at the start of a step, and which bodies were moved by hand or are new.

    LINK_STATE rows before and after -> the engine's `begin_step` -> START rows

With hooks they were read before the step. Otherwise those left by the step before hold, except for bodies that are new
or were moved since: there the simulator's own step is undone (`Undo`). A semi-implicit integrator has
x(n+1) = x(n) + v(n+1)·dt, so a pose that jumps farther than its speeds allow was moved by hand.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np

from sonic_bullet._engine import LEFT_OUT, START, begin_step
from sonic_bullet.records import Array
from sonic_bullet.simulators.frames import LINK_STATE, Motion, Roster, rows_of
from sonic_bullet.simulators.polling import Touches

__all__ = ["LEFT_OUT", "START"]

NOBODY = np.zeros(0, np.int64)

Undo = Callable[[Motion, Array, Touches, float], Motion]
"""(motion after the step, rows (n,) to undo, the step's contacts, its length) -> the motion one step earlier,
right in those rows.
"""


def start_table(roster: Roster) -> Array:
    """Make START rows (n,) of a roster with code and fixed filled and no body known."""
    table = np.zeros(len(roster.code), START)
    table["code"], table["fixed"], table["index"] = roster.code, roster.static, -1
    return table


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
    begin_step(_earlier(past, now, old), now.row, dt_s, np.array(sorted(by_hand), np.int64), True, start)
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
    begin_step(_earlier(past, now, old), now.row, dt_s, NOBODY, False, start)
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


def mark_jumped(past: Motion, now: Motion, dt_s: float) -> Array:
    """Mark the links (n,) of `now` that one step moved farther than both speeds explain, so by hand; new ones never."""
    start, old = start_table(now.roster), rows_of(past.roster, now.roster.code)
    begin_step(_earlier(past, now, old), now.row, dt_s, NOBODY, True, start)
    return np.asarray((start["moved"] != 0) & (old >= 0))


def _earlier(past: Motion, now: Motion, old: Array) -> Array:
    """Return MOTION rows (n,) of `past` in the order of `now`; a new link has its pose of now."""
    row, known = now.row.copy(), old >= 0
    row[known] = past.row[old[known]]
    return row
