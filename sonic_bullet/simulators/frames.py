"""Poses and twists of every link as arrays, in centre-of-mass frames, whatever simulator they come from.

Origin at the centre of mass, axes along the principal inertia: the frame of `Body`.
n rows: one for each link of each body, ordered by (body id, link).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet._engine import INVALID_BEYOND, LINK_SPAN, LINK_STATE
from sonic_bullet.records import Array

__all__ = ["INVALID_BEYOND", "LINK_SPAN", "LINK_STATE", "Motion", "Roster"]

MOTION_NUMBERS = 13
NO_NUMBER = "a pose or speed that is not a number, or beyond 1e9"


@dataclass(frozen=True, slots=True, eq=False)
class Roster:
    """The links in the world.

    Parameters
    ----------
    bodies
        (body id, number of joints, static) of each body.
    code : Array, shape (n,)
        body · LINK_SPAN + link + 1, ascending.
    static : Array of bool, shape (n,)
        Mass 0.
    count
        Number of all bodies when it was made, also of those it leaves out.
    soft
        Ids of soft bodies, which it leaves out.
    """

    bodies: tuple[tuple[int, int, bool], ...]
    code: Array
    static: Array
    count: int = 0
    soft: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Poses and twists of a roster at one instant, world frame.

    Parameters
    ----------
    roster
    row : Array of LINK_STATE, shape (n,)
        position_m (n, 3), quaternion_xyzw (n, 4), velocity_m_s (n, 3) of the centre of mass, spin_rad_s (n, 3).
    broken
        Ids of the bodies of which a number, as read, is NaN or `INVALID_BEYOND`.
    """

    roster: Roster
    row: Array
    broken: tuple[int, ...] = field(default=(), kw_only=True)

    @classmethod
    def of(
        cls, roster: Roster, position_m: Array, quaternion_xyzw: Array, velocity_m_s: Array, spin_rad_s: Array
    ) -> Motion:
        """Build a motion from its columns."""
        row = np.empty(len(position_m), LINK_STATE)
        for name, column in zip(
            LINK_STATE.names or (), (position_m, quaternion_xyzw, velocity_m_s, spin_rad_s), strict=True
        ):
            row[name] = column
        return cls(roster, row)

    @property
    def position_m(self) -> Array:
        """Position of the centre of mass (n, 3)."""
        return self.row["position_m"]

    @property
    def quaternion_xyzw(self) -> Array:
        """Orientation (n, 4)."""
        return self.row["quaternion_xyzw"]

    @property
    def velocity_m_s(self) -> Array:
        """Velocity of the centre of mass (n, 3)."""
        return self.row["velocity_m_s"]

    @property
    def spin_rad_s(self) -> Array:
        """Angular velocity (n, 3)."""
        return self.row["spin_rad_s"]

    @property
    def number(self) -> Array:
        """All numbers (n, 13)."""
        return self.row.view(np.float64).reshape(len(self.row), MOTION_NUMBERS)

    def would_move(self, dt_s: float) -> bool:
        """Tell whether a step must change some number.

        A body may rest on a fixed point of Bullet's arithmetic and keep every bit.
        """
        steps = self.position_m + dt_s * self.velocity_m_s != self.position_m
        return bool(steps.any() or (np.abs(self.spin_rad_s) * dt_s > 1e-12).any())


def select_rows(motion: Motion, roster: Roster, rows: Array) -> Motion:
    """Select rows (n,) of a motion as a motion of that roster."""
    return Motion(roster, motion.row[rows])


def without_body(motion: Motion, body: int | None) -> Motion:
    """Return the motion of all bodies but one; None: of no body."""
    roster = motion.roster
    keep = np.flatnonzero(roster.code // LINK_SPAN != body) if body is not None else np.zeros(0, int)
    bodies = tuple(entry for entry in roster.bodies if entry[0] != body and body is not None)
    return select_rows(motion, replace(roster, bodies=bodies, code=roster.code[keep], static=roster.static[keep]), keep)


def same_motion(first: Motion, second: Motion) -> bool:
    """Compare two motions, bit for bit."""
    return first.roster.bodies == second.roster.bodies and np.array_equal(first.number, second.number)


def encode(body: Array | int, link: Array | int) -> Array:
    """Return the row codes of (body, link) pairs."""
    return np.asarray(body, np.int64) * LINK_SPAN + np.asarray(link, np.int64) + 1


def decode(code: int) -> tuple[int, int]:
    """Return (body, link) of a row code."""
    return int(code) // LINK_SPAN, int(code) % LINK_SPAN - 1


def link_words(link: int) -> str:
    """Name a link in a message; an empty text for the base."""
    return "" if link < 0 else f" link {link}"


def rows_of(roster: Roster, code: Array) -> Array:
    """Find the row numbers of codes (k,); -1 where the roster does not hold them."""
    if not len(roster.code):
        return np.full(len(code), -1)
    row = np.minimum(np.searchsorted(roster.code, code), len(roster.code) - 1)
    return np.where(roster.code[row] == code, row, -1)


def rotate_orientations(quaternion_xyzw: Array, rotation_rad: Array) -> Array:
    """Rotate orientations (k, 4) by world-frame rotation vectors (k, 3)."""
    angle = np.linalg.norm(rotation_rad, axis=1, keepdims=True)
    y, v = rotation_rad * np.sinc(angle / (2 * np.pi)) / 2, np.cos(angle / 2)
    x, w = quaternion_xyzw[:, :3], quaternion_xyzw[:, 3:]
    result = np.concatenate([v * x + w * y + np.cross(y, x), v * w - (x * y).sum(axis=1, keepdims=True)], axis=1)
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


def advance_motion(motion: Motion, duration_s: float) -> Motion:
    """Integrate a motion by its own twists; a negative duration undoes Bullet's last semi-implicit step."""
    return Motion.of(
        motion.roster,
        motion.position_m + duration_s * motion.velocity_m_s,
        rotate_orientations(motion.quaternion_xyzw, duration_s * motion.spin_rad_s),
        motion.velocity_m_s,
        motion.spin_rad_s,
    )
