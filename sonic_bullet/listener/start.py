"""Poses and twists at the start of a step, and who was moved by hand or is new.

Hooked, they were read before the step. Otherwise those left by the step before hold, but not for bodies that are new or were
moved since: there Bullet's semi-implicit step is undone from what it left,

    x = x' - v' dt,   v = v' - g dt - ΣJ/m,   ω = ω' - I⁻¹ Σ (p - x) × J        (single bodies; of links only the pose)
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
import pybullet

from sonic_bullet.listener.frames import LINK_SPAN, Motion, Roster, advanced, decode, jumped, rows_of, with_driven_twists
from sonic_bullet.listener.polling import Touches
from sonic_bullet.records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """motion: at the start of the step. moved (n,): set elsewhere by hand since the step before. born (n,): in its first step."""

    motion: Motion
    moved: Array
    born: Array


def hooked_start(past: Motion | None, now: Motion, by_hand: Collection[int], dt_s: float) -> Start:
    """From the motion read before this step and the one read before the last (None: no step yet); by_hand: bodies known to be moved."""
    if past is None:
        return Start(now, np.zeros(len(now.roster.code), bool), np.ones(len(now.roster.code), bool))
    born = np.zeros(len(now.roster.code), bool) if past.roster is now.roster else rows_of(past.roster, now.roster.code) < 0
    moved = jumped(past, now, dt_s)
    if by_hand:
        moved |= np.isin(now.roster.code // LINK_SPAN, list(by_hand)) & ~born & ~now.roster.static
    return Start(with_driven_twists(past, now, dt_s), moved, born)


def polled_start(past: Motion, now: Motion, touches: Touches, dt_s: float, *, client_id: int, first: bool) -> Start:
    """From the motions read after the last step and after this one. What stands still by mass 0 stands where it stands now."""
    roster = now.roster
    old = rows_of(past.roster, roster.code)
    born, moved = old < 0, jumped(past, now, dt_s)
    driven = with_driven_twists(past, now, dt_s)
    start = past if past.roster is roster else taken(past, roster, np.maximum(old, 0)) if len(past.roster.code) else now
    start = chosen(roster.static, driven, start)
    lost = born | moved
    if lost.any():
        start = chosen(lost & ~roster.static, undone(now, lost, touches, dt_s, client_id), chosen(lost, now, start))
    if first:
        born, moved = np.ones_like(born), np.zeros_like(moved)
    return Start(start, moved, born)


def taken(motion: Motion, roster: Roster, rows: Array) -> Motion:
    """The rows (n,) of a motion as a motion of that roster."""
    return Motion(roster, *(column[rows] for column in motion.table))


def chosen(mask: Array, yes: Motion, no: Motion) -> Motion:
    """Rows of `yes` where mask (n,), else of `no`."""
    return Motion(yes.roster, *(np.where(mask[:, None], a, b) for a, b in zip(yes.table, no.table, strict=True)))


def undone(now: Motion, which: Array, touches: Touches, dt_s: float, client_id: int) -> Motion:
    """The motion one step earlier, right in the rows `which` (n,)."""
    settings = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)
    gravity = np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
    single = {body for body, joints, _ in now.roster.bodies if joints == 0}
    back = advanced(now, -dt_s)
    velocity, spin = back.velocity_m_s.copy(), back.spin_rad_s.copy()
    for row in np.flatnonzero(which & ~now.roster.static):
        code = now.roster.code[row]
        body, link = decode(code)
        info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
        if body not in single or not 0 < info[0] < np.inf:
            continue
        sign = (touches.code_a == code).astype(float) - (touches.code_b == code)
        own = sign != 0
        impulse = sign[own, None] * touches.impulse_n_s[own]
        point = np.where(touches.code_a[own, None] == code, touches.point_a_m[own], touches.point_b_m[own])
        turn = np.array(pybullet.getMatrixFromQuaternion(back.quaternion_xyzw[row])).reshape(3, 3)
        angular = np.cross(point - back.position_m[row], impulse).sum(axis=0)
        inverse = np.array([1 / x if x > 0 else 0.0 for x in info[2]])
        velocity[row] -= impulse.sum(axis=0) / info[0] + gravity * dt_s
        spin[row] -= turn @ (inverse * (turn.T @ angular))
    return Motion(now.roster, back.position_m, back.quaternion_xyzw, velocity, spin)
