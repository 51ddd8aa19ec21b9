"""Poses and twists at the start of each sub-step, of which PyBullet tells those of the whole step's start and end.

free bodies:  v' = v + g h + ΣJ/m,  ω' = ω + I⁻¹ Σ r × J,  x' = x + v' h        by the sub-step's own impulses
              + (k/n) · what is left between that and the end that PyBullet tells: damping, friction, constraints
jointed ones: on the line, and the shorter arc, from start to end
what is static, or driven by hand: as it is
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from fractions import Fraction

import numpy as np
import pybullet

from sonic_bullet.records import Array
from sonic_bullet.simulators.animated import matrices, rotation
from sonic_bullet.simulators.frames import LINK_SPAN, Motion, Roster, decode, rotate_orientations, rows_of
from sonic_bullet.simulators.polling import Touches

ROUNDS = 50
"""Over the contacts: as many as Bullet makes by default."""
DAMPING = 0.04
"""Bullet's default for both velocities, which PyBullet does not report."""
SLOW_M_S = 1e-9
"""Slip that needs no friction: below the rounding of what PyBullet's log holds, single precision."""


class MotionsWithin:
    """The motions of one client within its steps."""

    def __init__(self, client_id: int) -> None:
        self._client_id = client_id
        self._roster: Roster | None = None
        self._inverse_mass: Array = np.zeros(0)  # 0 of what does not move freely
        self._inverse_inertia: Array = np.zeros((0, 3))
        self._friction: Array = np.zeros(0)

    def read(
        self, start: Motion, end: Motion, touches: Sequence[Touches], h: float, gravity: Array, held: Collection[int]
    ) -> list[Motion]:
        """Return the motions at the start of each sub-step.

        Parameters
        ----------
        start, end
            Of the whole step.
        touches
            Loaded contacts of each sub-step.
        h
            Length of a sub-step in s.
        gravity : Array, shape (3,)
        held
            Bodies that stay as they are.
        """
        count, roster = len(touches), start.roster
        self._weigh(roster)
        free = (self._inverse_mass > 0) & ~np.isin(roster.code // LINK_SPAN, list(held))
        stays = roster.static | np.isin(roster.code // LINK_SPAN, list(held))
        states, sticking = [start.row], []
        for part in touches:
            state, stuck_n_s = self._advance(states[-1], part, roster, free, h, gravity)
            states.append(state)
            sticking.append(stuck_n_s)
        at_end = rows_of(end.roster, roster.code)
        known = at_end >= 0
        last = np.where(known, at_end, 0)
        for k in range(1, count + 1):
            states[k][stays] = start.row[stays]
        begin = {name: start.row[name] for name in ("position_m", "velocity_m_s", "spin_rad_s")}
        off = {name: np.where(known[:, None], end.row[name][last] - states[-1][name], 0.0) for name in begin}
        turn = np.where(known[:, None], rotation(states[-1]["quaternion_xyzw"], end.quaternion_xyzw[last]), 0.0)
        share, made = _shares(np.array(sticking)), [start]
        for k in range(1, count):
            row, fraction = states[k].copy(), np.where(free, share[k], k / count)[:, None]
            for name in begin:
                row[name][~stays] += (fraction * off[name])[~stays]
            row["quaternion_xyzw"][~stays] = rotate_orientations(
                row["quaternion_xyzw"][~stays], (fraction * turn)[~stays]
            )
            made.append(Motion(roster, row))
        return made

    def _advance(
        self, row: Array, part: Touches, roster: Roster, free: Array, h: float, gravity: Array
    ) -> tuple[Array, float]:
        """Return the state a sub-step later, and the impulse of contacts that stick; fill in the friction.

        What is not free stays: it ends on its line.
        """
        made = row.copy()
        touch = part.row
        inverse_kg = np.where(free, self._inverse_mass, 0.0)
        frame = matrices(row["quaternion_xyzw"])
        inverse = np.where(free[:, None, None], np.einsum("nij,nj,nkj->nik", frame, self._inverse_inertia, frame), 0.0)
        velocity, spin = (row[name] - h * _drag(row[name]) for name in ("velocity_m_s", "spin_rad_s"))
        velocity = velocity + h * np.where(free[:, None], gravity, 0.0)
        sides = [
            (rows_of(roster, touch[f"code_{x}"]), touch[f"point_{x}_m"], sign) for x, sign in (("a", 1.0), ("b", -1.0))
        ]
        arms = [np.where(at[:, None] >= 0, point - row["position_m"][at], 0.0) for at, point, _ in sides]

        def push(i: int, impulse: Array) -> None:
            for (at, _, sign), arm in zip(sides, arms, strict=True):
                one = at[i]
                if one >= 0:
                    velocity[one] += sign * inverse_kg[one] * impulse
                    spin[one] += sign * (inverse[one] @ _cross(arm[i], impulse))

        def slip(i: int) -> Array:
            total = np.zeros(3)
            for (at, _, sign), arm in zip(sides, arms, strict=True):
                one = at[i]
                if one >= 0:
                    total += sign * (velocity[one] + _cross(spin[one], arm[i]))
            normal = touch["normal"][i]
            return np.asarray(total - (total @ normal) * normal)

        normal_n_s = np.einsum("ki,ki->k", touch["impulse_n_s"], touch["normal"])
        for i in range(len(touch)):
            push(i, normal_n_s[i] * touch["normal"][i])
        most = normal_n_s * np.prod([np.where(at >= 0, self._friction[at], 0.0) for at, _, _ in sides], axis=0)
        mobility = np.zeros((len(touch), 3, 3))
        for (at, _, _), arm in zip(sides, arms, strict=True):
            cross = np.array([[np.zeros(len(arm)), -arm[:, 2], arm[:, 1]], [arm[:, 2], np.zeros(len(arm)), -arm[:, 0]],
                              [-arm[:, 1], arm[:, 0], np.zeros(len(arm))]]).transpose(2, 0, 1)  # fmt: skip
            mobility += inverse_kg[at][:, None, None] * np.eye(3) - cross @ inverse[at] @ cross
        held, axes = np.zeros((len(touch), 3)), _tangents(touch["normal"])
        yields = np.einsum("kix,kxy,kiy->ki", axes, mobility, axes)
        moves = [i for i in range(len(touch)) if most[i] > 0 and yields[i].min() > 0]
        for _ in range(ROUNDS):
            for i in moves:
                along = slip(i)
                if float(np.linalg.norm(along)) < SLOW_M_S:
                    continue
                wanted = held[i] - axes[i].T @ ((axes[i] @ along) / yields[i])
                size = float(np.linalg.norm(wanted))
                wanted *= min(1.0, most[i] / size) if size > 0 else 0.0
                push(i, wanted - held[i])
                held[i] = wanted
        for i in moves:
            touch["impulse_n_s"][i] = normal_n_s[i] * touch["normal"][i] + held[i]
        made["velocity_m_s"][free], made["spin_rad_s"][free] = velocity[free], spin[free]
        made["position_m"][free] += h * velocity[free]
        made["quaternion_xyzw"][free] = rotate_orientations(row["quaternion_xyzw"][free], h * spin[free])
        stuck = [i for i in moves if np.linalg.norm(held[i]) < (1 - 1e-6) * most[i]]
        return made, float(sum(normal_n_s[i] for i in stuck))

    def _weigh(self, roster: Roster) -> None:
        """Ask for masses and inertias of the bodies that move freely."""
        if self._roster is roster:
            return
        self._roster = roster
        self._inverse_mass, self._inverse_inertia = np.zeros(len(roster.code)), np.zeros((len(roster.code), 3))
        self._friction = np.zeros(len(roster.code))
        single = {body for body, joints, static in roster.bodies if joints == 0 and not static}
        for row, code in enumerate(roster.code.tolist()):
            body, link = decode(code)
            info = pybullet.getDynamicsInfo(body, link, physicsClientId=self._client_id)
            self._friction[row] = info[1]
            if body in single:
                self._inverse_mass[row] = 1 / info[0] if 0 < info[0] < np.inf else 0.0
                self._inverse_inertia[row] = [1 / x if x > 0 else 0.0 for x in info[2]]


def _cross(a: Array, b: Array) -> Array:
    """Return a × b (3,), the bits of `np.cross`, which takes thirty times as long of two vectors."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _tangents(normal: Array) -> Array:
    """Return the two directions (k, 2, 3) along which Bullet holds a contact [btPlaneSpace1]."""
    made = np.zeros((len(normal), 2, 3))
    for i, (x, y, z) in enumerate(normal):
        if abs(z) > np.sqrt(0.5):
            k = 1 / np.hypot(y, z)
            first = np.array([0.0, -z * k, y * k])
        else:
            k = 1 / np.hypot(x, y)
            first = np.array([-y * k, x * k, 0.0])
        made[i] = first, np.cross([x, y, z], first)
    return made


def _drag(velocity: Array) -> Array:
    """Compute what Bullet's damping takes of velocities (n, 3) in a second: d v (1 + |v|) [btMultiBody, DAMPING_K2]."""
    return np.asarray(DAMPING * velocity * (1 + np.linalg.norm(velocity, axis=1, keepdims=True)))


def _shares(sticking_n_s: Array) -> Array:
    """Return (n + 1,) which part of what the end tells otherwise was made before each sub-step, and before the end.

    Where contacts slide, their friction is known; where several stick, which of them holds how much is not.
    """
    count, total = len(sticking_n_s), sticking_n_s.sum()
    if total <= 0:
        return np.linspace(0.0, 1.0, count + 1)
    return np.concatenate([[0.0], np.cumsum(sticking_n_s) / total])


def substep_s(dt_s: float, count: int) -> float:
    """Return the length of a sub-step: of the ratio that the step was meant to be, 1/1200 of 1/240."""
    near = Fraction(dt_s).limit_denominator(1_000_000)
    return float((near if float(near) == dt_s else Fraction(dt_s)) / count)


def by_substep(touches: Touches, count: int, h: float) -> list[Touches]:
    """Return the contacts of each sub-step, from its own start."""
    number = np.clip(np.rint(touches.row["elapsed_s"] / h).astype(np.int64), 0, count - 1)
    parts = []
    for k in range(count):
        row = touches.row[number == k].copy()
        row["elapsed_s"] = 0.0
        parts.append(Touches(row))
    return parts
