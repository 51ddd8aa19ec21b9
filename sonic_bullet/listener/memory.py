"""State that a listener keeps from step to step, and the assembly of a step's rows.

RAW + MOTION before and after -> `usual`, one compiled call     -> CONTACT rows -> Step
Touches + START               -> `made`, where a case is unusual  /
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import NEW_LINKS, UNKNOWN_LINK, make_contact_rows, place_bodies, take_step
from sonic_bullet.listener.frames import Motion
from sonic_bullet.listener.known_bodies import KnownBodies
from sonic_bullet.listener.polling import NO_RAW, NO_TOUCH, Touches
from sonic_bullet.listener.sweep import Traces
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.contacts import CONTACT, Contacts, Step, first_bodies
from sonic_bullet.records.errors import LogError, SceneError

Poses = tuple[Array, Array, Array]
"""Position (b, 3) and quaternion (b, 4) of a step's bodies, and whether each was moved by hand (b,)."""


class Memory:
    """Contacts and poses of the last steps of one world.

    Attributes
    ----------
    touches
        Of the step before; None before the first.
    raw, raw_before
        RAW rows of the last poll and the one before it.
    time_s
        Start of the coming step.
    """

    def __init__(self) -> None:
        self.touches: Touches | None = None
        self.raw: Array = NO_RAW
        self.raw_before: Array = NO_RAW
        self.time_s = 0.0
        self._traces = Traces()
        self._checked: tuple[float, tuple[float, ...]] = (0.0, ())
        self._dt_s = 0.0
        self._gravity_m_s2 = np.zeros(3)
        self._poses = _room(0), first_bodies(0)

    def forget(self) -> None:
        """Drop all contacts."""
        self._traces.clear()
        self.touches = None

    def poll(self, raw: Array, *, stepped: bool) -> None:
        """Store the contacts just polled; where no step is known to be made, only if they differ from the last ones."""
        if stepped or raw.tobytes() != self.raw.tobytes():
            self.raw_before, self.raw = self.raw, raw

    def usual(
        self,
        known: KnownBodies,
        past: Motion,
        now: Motion,
        by_hand: Array,
        dt_s: float,
        gravity: tuple[float, ...],
        hooked: bool,
    ) -> Step | None:
        """Assemble a step of an unchanged roster in one call; None, with nothing changed, where a case is unusual."""
        k, traces = len(self.raw), self._traces
        traces.reserve(k)
        count, made, touch, row, position, quaternion, teleported = take_step(
            self.raw,
            self.raw_before,
            NO_TOUCH if self.touches is None else self.touches.row,
            past.row,
            now.row,
            by_hand,
            hooked,
            dt_s,
            self.time_s,
            traces,
            known.start(now.roster),
            len(known.body),
        )
        if made < 0:
            return None
        self.touches = Touches(touch if count == k else touch[:count])
        return self._step(dt_s, gravity, (position, quaternion, teleported), known.body, row, made)

    def made(
        self, known: KnownBodies, start: Array, touches: Touches, past: Touches | None, dt_s: float
    ) -> tuple[Array, int]:
        """Fill CONTACT rows (k,) of contacts.

        Returns
        -------
        tuple
            The rows, and how many are filled; NEW_LINKS where `start` marks links in their first contact.

        Raises
        ------
        SceneError
            A contact names a link that `start` does not hold.
        RecordError
            A number is beyond what can be.
        """
        traces, row = self._traces, np.zeros(len(touches), CONTACT)
        traces.reserve(len(touches))
        before = NO_TOUCH if past is None else past.row
        count = make_contact_rows(touches.row, before, start, dt_s, self.time_s, traces, row)
        if count == UNKNOWN_LINK:
            raise SceneError(
                "a contact names a body that is not in the world", "step the simulation once before listening on"
            )
        if count < 0 and count != NEW_LINKS:
            Contacts.of(row)
        return row, count

    def unusual(
        self, known: KnownBodies, start: Array, row: Array, made: int, dt_s: float, gravity: tuple[float, ...]
    ) -> Step:
        """Assemble the step of rows that `made` filled; `start` is as `known.enter` left it."""
        poses = _room(len(known.body))
        place_bodies(start, *poses)
        return self._step(dt_s, gravity, poses, known.body, row, made)

    def nothing(self, dt_s: float, gravity: tuple[float, ...]) -> Step:
        """Return a step without contacts in which all bodies are where they were in the last one."""
        self._check(dt_s, gravity)
        poses, body = self._poses
        still = poses[0], poses[1], np.zeros(len(body), bool)
        return Step.trusted(self._dt_s, *still, Contacts.none(), self._gravity_m_s2, body)

    def _check(self, dt_s: float, gravity: tuple[float, ...]) -> None:
        if self._checked != (dt_s, gravity):
            remedy = "set a time step between 0 and 1 s with setTimeStep"
            self._dt_s = as_number(dt_s, "dt_s of a physics step", remedy, above=0, most=1, error=LogError)
            self._gravity_m_s2 = frozen_array(np.array(gravity), float, (3,), "step: gravity_m_s2")
            self._checked = dt_s, gravity

    def _step(self, dt_s: float, gravity: tuple[float, ...], poses: Poses, body: Array, row: Array, made: int) -> Step:
        self._check(dt_s, gravity)
        self._traces.turn()
        self.time_s += dt_s
        self._poses = poses, body
        if made == 0:
            contacts = Contacts.none()
        else:
            row = row if made == len(row) else row[:made].copy()
            row.flags.writeable = False
            contacts = Contacts.trusted(row)
        return Step.trusted(self._dt_s, *poses, contacts, self._gravity_m_s2, body)


def _room(bodies: int) -> Poses:
    return np.empty((bodies, 3)), np.empty((bodies, 4)), np.empty(bodies, bool)
