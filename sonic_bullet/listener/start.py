"""Poses and twists at the start of a step, and who was moved by hand or is new.

Hooked, they were read before the step. Otherwise those left by the step before hold, but not for bodies that are new or
were moved since: there the simulator's own step is taken back (`Undo`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from sonic_bullet.listener.frames import LINK_SPAN, Motion, Roster, jumped, rows_of, with_driven_twists
from sonic_bullet.listener.polling import Touches
from sonic_bullet.records import Array

Undo = Callable[[Motion, Array, Touches, float], Motion]
"""(motion after the step, rows (n,) to take back, the step's contacts, its length) -> the motion one step earlier,
right in those rows.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """motion: at the start of the step.

    moved (n,): set elsewhere by hand since the step before. born (n,): in its first step.
    """

    motion: Motion
    moved: Array
    born: Array


def hooked_start(past: Motion | None, now: Motion, by_hand: Collection[int], dt_s: float) -> Start:
    """From the motion read before this step and the one read before the last (None: no step yet); by_hand: bodies
    known to be moved.
    """
    if past is None:
        return Start(now, np.zeros(len(now.roster.code), bool), np.ones(len(now.roster.code), bool))
    born = (
        np.zeros(len(now.roster.code), bool) if past.roster is now.roster else rows_of(past.roster, now.roster.code) < 0
    )
    moved = jumped(past, now, dt_s)
    if by_hand:
        moved |= np.isin(now.roster.code // LINK_SPAN, list(by_hand)) & ~born & ~now.roster.static
    return Start(with_driven_twists(past, now, dt_s), moved, born)


def polled_start(past: Motion, now: Motion, touches: Touches, dt_s: float, *, undo: Undo, first: bool) -> Start:
    """From the motions read after the last step and after this one.

    What stands still by mass 0 stands where it stands now.

    undo: takes a step back where nothing was read before it.
    """
    roster = now.roster
    old = rows_of(past.roster, roster.code)
    born, moved = old < 0, jumped(past, now, dt_s)
    driven = with_driven_twists(past, now, dt_s)
    start = past if past.roster is roster else taken(past, roster, np.maximum(old, 0)) if len(past.roster.code) else now
    start = chosen(roster.static, driven, start)
    lost = born | moved
    if lost.any():
        start = chosen(lost & ~roster.static, undo(now, lost, touches, dt_s), chosen(lost, now, start))
    if first:
        born, moved = np.ones_like(born), np.zeros_like(moved)
    return Start(start, moved, born)


def taken(motion: Motion, roster: Roster, rows: Array) -> Motion:
    """The rows (n,) of a motion as a motion of that roster."""
    return Motion(roster, *(column[rows] for column in motion.table))


def chosen(mask: Array, yes: Motion, no: Motion) -> Motion:
    """Rows of `yes` where mask (n,), else of `no`."""
    return Motion(yes.roster, *(np.where(mask[:, None], a, b) for a, b in zip(yes.table, no.table, strict=True)))
