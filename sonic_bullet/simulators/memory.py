"""State that a listener keeps from step to step, and the assembly of a step's rows.

Touches + START -> `made` -> CONTACT rows -> `unusual` -> Step
"""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import NEW_LINKS, UNKNOWN_LINK, make_contact_rows, place_bodies
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.contacts import CONTACT, Contacts, Step, as_step_length, first_bodies
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.known_bodies import KnownBodies
from sonic_bullet.simulators.polling import NO_TOUCH, Touches
from sonic_bullet.simulators.sweep import Traces

Poses = tuple[Array, Array, Array]
"""Position (b, 3) and quaternion (b, 4) of a step's bodies, and whether each was moved by hand (b,)."""


class Memory:
    """Contacts and poses of the last steps of one world.

    Attributes
    ----------
    touches
        Of the step before; None before the first.
    traces
        Contacts of the last steps.
    time_s
        Start of the coming step.
    poses
        Of the last step's bodies, and these.
    """

    def __init__(self) -> None:
        self.touches: Touches | None = None
        self.time_s = 0.0
        self.traces = Traces()
        self._checked: tuple[float, tuple[float, ...]] = (0.0, ())
        self._dt_s = 0.0
        self._gravity_m_s2 = np.zeros(3)
        self.poses = room(0), first_bodies(0)

    def forget(self) -> None:
        """Drop all contacts."""
        self.traces.clear()
        self.touches = None

    def fill_contacts(
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
        traces, row = self.traces, np.zeros(len(touches), CONTACT)
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
        poses = room(len(known.body))
        place_bodies(start, *poses)
        return self._step(dt_s, gravity, poses, known.body, row, made)

    def empty_step(self, dt_s: float, gravity: tuple[float, ...]) -> Step:
        """Return a step without contacts in which all bodies are where they were in the last one."""
        self.check(dt_s, gravity)
        poses, body = self.poses
        still = poses[0], poses[1], np.zeros(len(body), bool)
        return Step.of_trusted(self._dt_s, *still, Contacts.none(), self._gravity_m_s2, body)

    def check(self, dt_s: float, gravity: tuple[float, ...]) -> None:
        """Raise LogError unless a step can be so long."""
        if self._checked != (dt_s, gravity):
            self._dt_s = as_step_length(dt_s)
            self._gravity_m_s2 = frozen_array(np.array(gravity), float, (3,), "step: gravity_m_s2")
            self._checked = dt_s, gravity

    def turn(self, dt_s: float) -> None:
        """Advance by a step."""
        self.traces.turn()
        self.time_s += dt_s

    def _step(self, dt_s: float, gravity: tuple[float, ...], poses: Poses, body: Array, row: Array, made: int) -> Step:
        self.check(dt_s, gravity)
        self.turn(dt_s)
        self.poses = poses, body
        if made == 0:
            contacts = Contacts.none()
        else:
            row = row if made == len(row) else row[:made].copy()
            row.flags.writeable = False
            contacts = Contacts.of_trusted(row)
        return Step.of_trusted(self._dt_s, *poses, contacts, self._gravity_m_s2, body)


def room(bodies: int) -> Poses:
    """Return space for the poses of so many bodies."""
    return np.empty((bodies, 3)), np.empty((bodies, 4)), np.empty(bodies, bool)
