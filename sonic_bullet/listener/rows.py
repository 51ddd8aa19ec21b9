"""Rows of one step: which touches count, and what the sound needs to know of each. k touches, n rows of a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.contacts import Contacts
from sonic_bullet.listener.frames import Motion, rows_of, turned
from sonic_bullet.listener.kinematics import into_frame, relative_motion
from sonic_bullet.listener.polling import Touches
from sonic_bullet.listener.start import Start
from sonic_bullet.listener.sweep import Trace, match, remembered, stacked
from sonic_bullet.records import Array

SPAWN_DEPTH_M = 1e-4


def awake(touches: Touches, past: Touches | None, motion: Motion) -> Array:
    """(k,) False in islands asleep: both bodies stand exactly still and the contact is one of the step before, bit for bit."""
    result = np.ones(len(touches), bool)
    if past is None or not len(touches):
        return result
    still = np.asarray(~(motion.velocity_m_s.any(axis=1) | motion.spin_rad_s.any(axis=1)))
    still_a, still_b = still[rows_of(motion.roster, touches.code_a)], still[rows_of(motion.roster, touches.code_b)]
    quiet = np.flatnonzero(still_a & still_b)
    if len(quiet):
        before = set(_fingerprints(past, np.arange(len(past))))
        result[quiet] = np.array([mark not in before for mark in _fingerprints(touches, quiet)])
    return result


def _fingerprints(touches: Touches, rows: Array) -> list[bytes]:
    columns = np.concatenate([touches.point_a_m[rows], touches.impulse_n_s[rows], touches.code_a[rows, None], touches.code_b[rows, None]], axis=1)
    return [row.tobytes() for row in columns]


def counted(touches: Touches, start: Start, approach_m_s: Array, dt_s: float) -> Array:
    """(k,) False where a body was moved by hand, or is in its first step and deeper inside its partner than its speed explains."""
    row_a, row_b = rows_of(start.motion.roster, touches.code_a), rows_of(start.motion.roster, touches.code_b)
    inside = touches.gap_m < -(SPAWN_DEPTH_M + np.maximum(approach_m_s, 0) * dt_s)
    return np.asarray(~(start.moved[row_a] | start.moved[row_b] | ((start.born[row_a] | start.born[row_b]) & inside)))


def slips(touches: Touches, motion: Motion) -> tuple[Array, Array]:
    """slip (k, 3) and approach (k,) in m/s before the step."""
    row_a, row_b = rows_of(motion.roster, touches.code_a), rows_of(motion.roster, touches.code_b)
    slip, approach = relative_motion(
        touches.point_a_m, touches.point_b_m, touches.normal, motion.position_m, motion.velocity_m_s, motion.spin_rad_s, row_a, row_b
    )
    return slip, approach


@dataclass(frozen=True, slots=True, eq=False)
class Meeting:
    """Touches (k rows) with who meets, a, b (k,) indices of bodies, and slip (k, 3), approach (k,) in m/s before the step."""

    touches: Touches
    a: Array
    b: Array
    slip_m_s: Array
    approach_m_s: Array


def contact_rows(meeting: Meeting, motion: Motion, time_s: float, traces: tuple[Trace, ...]) -> tuple[Contacts, tuple[Trace, ...]]:
    """Contacts of a meeting, and the traces that the next step will look for them in."""
    touches, a, b, slip, approach = meeting.touches, meeting.a, meeting.b, meeting.slip_m_s, meeting.approach_m_s
    if not len(touches):
        none = Contacts.none()
        return none, remembered(traces, Trace(np.zeros(0, np.int64), np.zeros(0), none.point_a_m, none.point_a_m, none.point_a_m))
    row_a, row_b = rows_of(motion.roster, touches.code_a), rows_of(motion.roster, touches.code_b)
    xa, qa, xb, qb = motion.position_m[row_a], motion.quaternion_xyzw[row_a], motion.position_m[row_b], motion.quaternion_xyzw[row_b]
    if touches.elapsed_s.any():
        late = touches.elapsed_s[:, None]
        xa, xb = xa + late * motion.velocity_m_s[row_a], xb + late * motion.velocity_m_s[row_b]
        qa, qb = turned(qa, late * motion.spin_rad_s[row_a]), turned(qb, late * motion.spin_rad_s[row_b])
    point_a, point_b = into_frame(touches.point_a_m, xa, qa), into_frame(touches.point_b_m, xb, qb)
    fixed_a, fixed_b = motion.roster.static[row_a], motion.roster.static[row_b]
    far_a, far_b = np.sqrt((point_a**2).sum(axis=1)), np.sqrt((point_b**2).sum(axis=1))
    relative_spin = motion.spin_rad_s[row_a] - motion.spin_rad_s[row_b]
    roll = np.sqrt((relative_spin**2).sum(axis=1)) * np.maximum(np.where(fixed_a, 0, far_a), np.where(fixed_b, 0, far_b))
    settle_a = ~fixed_a & (fixed_b | (far_a <= far_b))
    pair = a.astype(np.int64) << 32 | b
    time = time_s + touches.elapsed_s
    columns, starts = stacked(traces)
    over_a = match(columns, starts, pair, time, point_a, point_b, qa, qb, touches.normal, slip, roll, settle_a)
    sweep = np.sqrt(np.stack([(over_a**2).sum(axis=1), ((over_a + slip) ** 2).sum(axis=1)], axis=1))
    gap = touches.gap_m + np.maximum(approach, 0) * touches.elapsed_s
    contacts = Contacts(a, b, point_a, point_b, touches.normal, touches.impulse_n_s, slip, sweep, approach, gap)
    return contacts, remembered(traces, Trace(pair, time, point_a, point_b, over_a))
