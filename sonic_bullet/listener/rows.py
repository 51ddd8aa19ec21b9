"""Rows of one step: which touches count, and what the sound needs to know of each. k touches, n rows of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.listener.frames import Motion, rows_of
from sonic_bullet.listener.kinematics import relative_motion
from sonic_bullet.listener.polling import Touches
from sonic_bullet.listener.start import Start
from sonic_bullet.listener.sweep import Trace, place_and_match, remembered
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts
from sonic_bullet.records.errors import SceneError

SPAWN_DEPTH_M = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Meetings:
    """Touches that count, with rows row_a, row_b (k,) of the motion and slip (k, 3), approach (k,) in m/s before the
    step.
    """

    touches: Touches
    row_a: Array
    row_b: Array
    slip_m_s: Array
    approach_m_s: Array

    def kept(self, mask: Array) -> Meetings:
        """Only the touches where mask (k,) is True."""
        return Meetings(
            self.touches.kept(mask), self.row_a[mask], self.row_b[mask], self.slip_m_s[mask], self.approach_m_s[mask]
        )


def meetings(touches: Touches, past: Touches | None, start: Start, dt_s: float) -> Meetings:
    """Touches without those asleep, moved by hand, or of a body in its first step and deeper inside its partner than
    its speed explains.

    past: the touches of the step before. Raises SceneError for a touch of a body that the motion does not hold.
    """
    motion = start.motion
    row_a, row_b = rows_of(motion.roster, touches.code_a), rows_of(motion.roster, touches.code_b)
    if len(touches) and min(row_a.min(), row_b.min()) < 0:
        raise SceneError(
            "a contact names a body that is not in the world", "step the simulation once before listening on"
        )
    slip, approach = relative_motion(touches.point_a_m, touches.point_b_m, touches.normal, motion.table, row_a, row_b)
    drop = _asleep(touches, past, motion, row_a, row_b)
    if start.moved.any():
        drop |= start.moved[row_a] | start.moved[row_b]
    if start.born.any():
        inside = touches.gap_m < -(SPAWN_DEPTH_M + np.maximum(approach, 0) * dt_s)
        drop |= (start.born[row_a] | start.born[row_b]) & inside
    meeting = Meetings(touches, row_a, row_b, slip, approach)
    return meeting.kept(~drop) if drop.any() else meeting


def _asleep(touches: Touches, past: Touches | None, motion: Motion, row_a: Array, row_b: Array) -> Array:
    """(k,) True where both bodies stand exactly still and the contact is one of the step before, bit for bit."""
    result = np.zeros(len(touches), bool)
    still = np.asarray(~(motion.velocity_m_s.any(axis=1) | motion.spin_rad_s.any(axis=1)))
    if past is None or np.count_nonzero(still) < 2:
        return result
    quiet = np.flatnonzero(still[row_a] & still[row_b])
    if len(quiet):
        before = set(_fingerprints(past, np.arange(len(past))))
        result[quiet] = np.array([mark in before for mark in _fingerprints(touches, quiet)])
    return result


def _fingerprints(touches: Touches, rows: Array) -> list[bytes]:
    columns = np.concatenate(
        [touches.point_a_m[rows], touches.impulse_n_s[rows], touches.code_a[rows, None], touches.code_b[rows, None]],
        axis=1,
    )
    return [row.tobytes() for row in columns]


def contact_rows(
    meeting: Meetings, a: Array, b: Array, motion: Motion, time_s: float, traces: tuple[Trace, ...]
) -> tuple[Contacts, tuple[Trace, ...]]:
    """Contacts of the bodies a, b (k,) (indices), and the traces that the next step will look for them in."""
    touches, slip = meeting.touches, meeting.slip_m_s
    pair = a.astype(np.int64) << 32 | b
    rows, speed = place_and_match(
        traces,
        pair,
        time_s + touches.elapsed_s,
        touches.elapsed_s,
        touches.point_a_m,
        touches.point_b_m,
        touches.normal,
        slip,
        motion.table,
        motion.roster.static,
        meeting.row_a,
        meeting.row_b,
    )
    gap = touches.gap_m + np.maximum(meeting.approach_m_s, 0) * touches.elapsed_s
    contacts = Contacts(
        a, b, rows[:, 1:4], rows[:, 4:7], touches.normal, touches.impulse_n_s, slip, speed, meeting.approach_m_s, gap
    )
    return contacts, remembered(traces, pair, rows)
