"""What a listener remembers from step to step, and how a step's rows are made of it.

RAW + MOTION before and after -> `usual`, one compiled call     -> CONTACT rows -> Step
Touches + START               -> `made`, where it is not so     /
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.listener.frames import MOTION, Motion, Roster
from sonic_bullet.listener.known_bodies import KnownBodies
from sonic_bullet.listener.polling import NO_RAW, NO_TOUCH, TOUCH, Touches, loaded
from sonic_bullet.listener.rows import STRANGERS, UNKNOWN, contact_rows, place_bodies, take_step
from sonic_bullet.listener.start import NOBODY, hooked_start
from sonic_bullet.listener.sweep import Traces
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.contacts import CONTACT, Contacts, Step, first_bodies
from sonic_bullet.records.errors import LogError, SceneError

Poses = tuple[Array, Array, Array]
"""Of a step's bodies: position (b, 3), quaternion (b, 4), and who was moved by hand (b,)."""


class Memory:
    """State of that for one world.

    touches: the step before's, None before the first. raw, raw_before: RAW rows of the last poll and the one before it.
    time_s: of the coming step.
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
        """All that touched is gone."""
        self._traces.clear()
        self.touches = None

    def poll(self, raw: Array, *, stepped: bool) -> None:
        """Keep the contacts just polled; not `stepped`: only where they are others, for polled twice a world tells the
        same twice.
        """
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
        """The step of a world of the same roster as the step before, in one call; None where something is unusual, and
        nothing is changed then.
        """
        k, traces = len(self.raw), self._traces
        traces.reserve(k)
        touch, row = np.empty(k, TOUCH), np.empty(k, CONTACT)
        start = known.start(now.roster)
        poses = _room(len(known.body))
        count, made = take_step(
            self.raw,
            self.raw_before,
            touch,
            NO_TOUCH if self.touches is None else self.touches.row,
            past.row,
            now.row,
            by_hand,
            hooked,
            start,
            dt_s,
            self.time_s,
            traces.table,
            traces.count,
            traces.newest,
            traces.work,
            row,
            *poses,
        )
        if made < 0:
            return None
        self.touches = Touches(touch if count == k else touch[:count])
        return self._step(dt_s, gravity, poses, known.body, row, made)

    def made(
        self, known: KnownBodies, start: Array, touches: Touches, past: Touches | None, dt_s: float
    ) -> tuple[Array, int]:
        """CONTACT rows (k,) of touches and how many of them are filled; STRANGERS where `start` marks links that meet
        somebody for the first time.

        Raises SceneError for a touch of a link that `start` does not hold, RecordError for numbers beyond what can be.
        """
        traces, row = self._traces, np.zeros(len(touches), CONTACT)
        traces.reserve(len(touches))
        count = contact_rows(
            touches.row,
            len(touches),
            NO_TOUCH if past is None else past.row,
            start,
            dt_s,
            self.time_s,
            traces.table,
            traces.count,
            traces.newest,
            traces.work,
            row,
        )
        if count == UNKNOWN:
            raise SceneError(
                "a contact names a body that is not in the world", "step the simulation once before listening on"
            )
        if count < 0 and count != STRANGERS:
            Contacts.of(row)
        return row, count

    def unusual(
        self, known: KnownBodies, start: Array, row: Array, made: int, dt_s: float, gravity: tuple[float, ...]
    ) -> Step:
        """The step of rows that `made` made; `start` is as `known.enter` left it."""
        poses = _room(len(known.body))
        place_bodies(start, *poses)
        return self._step(dt_s, gravity, poses, known.body, row, made)

    def nothing(self, dt_s: float, gravity: tuple[float, ...]) -> Step:
        """A step in which nothing happens: all is where it was in the last one."""
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


def make_ready() -> None:
    """Have the machine code of a step, compiled now where it is not kept: what the first step would else wait for."""
    memory, known, dt_s, gravity = Memory(), KnownBodies(), 1 / 240, (0.0, 0.0, 0.0)
    motion = Motion(Roster((), np.zeros(0, np.int64), np.zeros(0, bool)), np.zeros(0, MOTION))
    touches, start = loaded(NO_RAW, NO_RAW, dt_s), hooked_start(motion, motion, (), dt_s)
    known.enter(start)
    memory.unusual(known, start, *memory.made(known, start, touches, touches, dt_s), dt_s, gravity)
    memory.usual(known, motion, motion, NOBODY, dt_s, gravity, True)
