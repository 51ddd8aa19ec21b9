"""A PyBullet world as the sound sees it: bodies by value, and one `Step` for each physics step.

    before_step():  poses and twists                (with a hook; else those left by the previous step)
    stepSimulation
    after_step():   contacts, asked for once -> rows in body frames -> Step

Contact positions belong to the pose at the start of the step, so that is the pose all rows use. No row is made of:
pairs without force; islands asleep (speeds exactly 0, contacts bit-identical to the step before); a second poll without
a step between (everything bit-identical); a body moved by hand since the last step; and the first step of a body that
began its life inside another, for then the position correction leaks into the impulse; and whoever `left_out` names:
one body whose numbers break takes nothing from the sound of the others.
"""

from __future__ import annotations

import inspect
import numbers
import weakref
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.listener.body_records import BodyRecords
from sonic_bullet.listener.frames import LINK_SPAN, Motion, Roster, encode, jumped, rows_of, same_motion
from sonic_bullet.listener.polling import Touches
from sonic_bullet.listener.pybullet import body_facts as facts
from sonic_bullet.listener.pybullet import collision_shapes as shapes
from sonic_bullet.listener.pybullet import hooks
from sonic_bullet.listener.pybullet.census import Census, ask
from sonic_bullet.listener.pybullet.contact_reader import ContactReader
from sonic_bullet.listener.pybullet.left_out import BodiesLeftOut
from sonic_bullet.listener.pybullet.poses import check_connected
from sonic_bullet.listener.pybullet.step_back import undone
from sonic_bullet.listener.rows import Meetings, contact_rows, meetings
from sonic_bullet.listener.start import Start, hooked_start, polled_start, taken
from sonic_bullet.listener.sweep import NO_TRACES, Trace
from sonic_bullet.listener.world import World
from sonic_bullet.records import Array, Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import Contacts, Step


class PyBulletWorld(World):
    """State of listening to one client: who lives, what was last seen, what is remembered of contacts.

    Made by open_world.
    """

    def __init__(self, client: Any, client_id: int) -> None:
        # a client that is dropped is to disconnect
        self._client = weakref.ref(client) if hasattr(client, "__weakref__") else lambda: client
        self.client_id = client_id
        self.epoch = 0
        self.step_count = 0
        self.stepped = False
        self._records = BodyRecords()
        self._time_s = 0.0
        self._gravity_m_s2 = np.zeros(3)
        self._census = Census(client_id, self._bury, self._end)
        self._before: Motion | None = None
        self._past_touches: Touches | None = None
        self._contacts = ContactReader(client_id)
        self._moved: set[int] = set()
        self._traces: tuple[Trace, ...] = NO_TRACES
        self._uninstall: Callable[[], None] | None = None
        self._contacts.prepare(self._step_length()[1])
        self._past: Motion = self._census.read()

    @property
    def client(self) -> Any:
        """What is listened to; None once it was dropped."""
        return self._client()

    @property
    def left_out(self) -> BodiesLeftOut:
        """Who of the world is left out, and what was said of it."""
        return self._census.left_out

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies ever met, in the order that Contacts.a and Contacts.b count them."""
        return tuple(self._records.bodies)

    @property
    def untouched(self) -> frozenset[int]:
        """Ids of the bodies that were in the world at the last step and have met nobody yet."""
        return frozenset(body for body, _, _ in self._past.roster.bodies) - {
            code // LINK_SPAN for code in self._records.living
        }

    @property
    def notes(self) -> tuple[str, ...]:
        """What of the world is left out of the sound, and why."""
        return tuple(self.left_out.notes)

    def listen(self, after: Callable[[], object]) -> bool:
        """Hook the client's steps, unless it is the pybullet module or a client id: those have no instance to hook."""
        if isinstance(self.client, numbers.Integral) or inspect.ismodule(self.client):
            return False
        self.hook(self.before_step, after)
        return True

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        """The body's id and its links of that number or name, "all" of them. Raises SceneError, MeshError."""
        from sonic_bullet.listener.pybullet.clients import links_called

        return links_called(self, body, link)

    @property
    def has_bodies(self) -> bool:
        """Whether anybody was in the world at the last step."""
        return bool(self._past.roster.bodies)

    def index_of(self, body: int, link: int = -1) -> int:
        """Index into `bodies` of the living record of a link, or -1."""
        return self._records.index_of(int(encode(body, link)))

    def add(
        self,
        body: int,
        link: int = -1,
        *,
        material: Material | None = None,
        model: ModalModel | None = None,
        volume_m3: float | None = None,
        shapes: Sequence[Shape] = (),
        name: str | None = None,
    ) -> Body:
        """Make a link known, with what it is made of; its record, which `bodies` holds from now on.

        A record that exists already (a silent partner, or an earlier add) ends with this step and a new one begins.
        volume_m3 None: the model's volume, or 0. shapes: its true geometry where that is not its collision shape; a
        lone sphere tells its curvature. A body that was muted is listened to again. Raises SceneError for an unknown
        body or link, a soft body, or a mass, pose or speed that is not one.
        """
        check_connected(self.client_id)
        facts.check_exists(self.client_id, body, link)
        facts.check_usable(self.client_id, body)
        if body in self.left_out.muted:
            self.left_out.forget(body)
            self._census.stale()
        self._census.read()
        record = facts.describe(self.client_id, body, link, self.epoch)
        volume = volume_m3 if volume_m3 is not None else (model.volume_m3 if model else 0.0)
        record = replace(
            record,
            material=material,
            model=model,
            volume_m3=volume,
            since_step=self.step_count,
            name=name or record.name,
        )
        if shapes:
            alone = shapes[0] if len(shapes) == 1 and shapes[0].kind == "sphere" else None
            record = replace(record, curvature_per_m=1 / float(alone.size_m[0]) if alone is not None else float("nan"))
        self._close([int(encode(body, link))])
        self._append(int(encode(body, link)), record)
        return record

    def name_of(self, body: int, link: int = -1) -> str:
        """What people call a link: its name and its body's id. Raises SceneError for an unknown one."""
        check_connected(self.client_id)
        facts.check_exists(self.client_id, body, link)
        name = facts.link_name(self.client_id, body, link)
        return name if name == f"body {body}" else f"{name} (body {body})"

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        """Geometry of a link in its body frame. Raises SceneError for an unknown one, MeshError where it has none."""
        check_connected(self.client_id)
        facts.check_exists(self.client_id, body, link)
        return shapes.shapes_of(self.client_id, body, link)

    def forget(self, body: int | None = None) -> None:
        """Say that a body was removed (None: all, by resetSimulation); its id may be given anew. With a hook, nobody
        need call this.
        """
        self.epoch += 1
        self.left_out.forget(body)
        self._close([code for code in self._records.living if body is None or code // LINK_SPAN == body])
        if body is None:
            self._contacts.abandon()
            self._traces, self._past_touches = NO_TRACES, None
        past = self._past.roster
        keep = np.flatnonzero(past.code // LINK_SPAN != body) if body is not None else np.zeros(0, int)
        self._past = taken(
            self._past,
            replace(
                past,
                bodies=tuple(e for e in past.bodies if e[0] != body and body is not None),
                code=past.code[keep],
                static=past.static[keep],
            ),
            keep,
        )
        self._moved = {x for x in self._moved if body is not None and x != body}
        self._census.stale()

    def mark_moved(self, body: int | None) -> None:
        """Note that a body (None: every body) was moved by hand before the coming step."""
        self._moved.update([body] if body is not None else [entry[0] for entry in self._past.roster.bodies])

    def mark_changed(self) -> None:
        """Note that masses may have changed: who is static is read again."""
        self._census.stale()

    def hook(self, before: Callable[[], object], after: Callable[[], object]) -> None:
        """Call `before` and `after` round every stepSimulation of a BulletClient; `before` is, or calls, `before_step`.

        Raises SceneError for the pybullet module or a client id: they have no instance to hook.
        """
        self.unhook()
        self._uninstall = hooks.install(self, before, after)

    def unhook(self) -> None:
        """Leave the client as it was and end the sub-step log; harmless when not hooked."""
        if self._uninstall is not None:
            self._uninstall()
            self._uninstall = None
        self._before = None
        if self.client is None:
            self._contacts.abandon()  # its id may be another's by now
        else:
            self._contacts.close()

    def before_step(self) -> None:
        """Read poses and twists at the start of the step. Raises SceneError (lost connection)."""
        self._contacts.prepare(self._step_length()[1])
        self._before = self._census.read()

    def after_step(self) -> Step:
        """This step's record.

        Call once after each stepSimulation; a second call without a step between finds no contacts.

        `stepped` tells whether there was a step. Without a hook, a missing one is known by a world in motion that
        stands where it stood, to the bit; where nothing moves at all, a second call passes for a step. Raises
        SceneError: lost connection, sub-steps that cannot be heard.
        """
        dt, substeps = self._step_length()
        self.stepped = self._uninstall is None or self._before is not None
        if not self.stepped:
            return self._again(dt)
        touches = self._contacts.touches(dt, substeps)
        first, past_touches = self.step_count == 0, self._past_touches
        now = self._before if self._before is not None else self._census.read()
        touches = self._census.usable(touches)
        if self._before is not None:
            start = hooked_start(None if first else self._past, now, self._moved, dt)
        else:
            frozen = not first and same_motion(self._past, now)
            if frozen and now.would_move(dt) and past_touches is not None and touches.equals(past_touches):
                self.stepped = False
                return self._again(dt)
            self._expose_impostors(now, dt)
            start = polled_start(
                self._past, now, touches, dt, undo=partial(undone, client_id=self.client_id), first=first
            )
        self._past_touches, self._past, self._before = touches, now, None
        meeting = meetings(touches, past_touches, start, dt)
        of_row = self._of_row(now.roster, meeting)
        meeting = meeting.kept((of_row[meeting.row_a] >= 0) & (of_row[meeting.row_b] >= 0))
        contacts, self._traces = contact_rows(
            meeting, of_row[meeting.row_a], of_row[meeting.row_b], start.motion, self._time_s, self._traces
        )
        step = self._step(dt, start, of_row, contacts)
        self._moved.clear()
        self._time_s += dt
        self.step_count += 1
        return step

    def _again(self, dt: float) -> Step:
        """A step in which nothing happens."""
        return Step(
            dt,
            self._records.position_m,
            self._records.quaternion_xyzw,
            np.zeros(len(self._records.bodies), bool),
            Contacts.none(),
            self._gravity_m_s2,
        )

    def _step(self, dt: float, start: Start, of_row: Array, contacts: Contacts) -> Step:
        row = np.flatnonzero(of_row >= 0)
        index, records = of_row[row], self._records
        teleported = np.zeros(len(records.bodies), bool)
        records.position_m[index] = start.motion.position_m[row]
        records.quaternion_xyzw[index] = start.motion.quaternion_xyzw[row]
        teleported[index] = start.moved[row]
        return Step(dt, records.position_m, records.quaternion_xyzw, teleported, contacts, self._gravity_m_s2)

    def _step_length(self) -> tuple[float, int]:
        settings = ask(self.client_id, pybullet.getPhysicsEngineParameters)
        self._gravity_m_s2 = np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
        return settings["fixedTimeStep"], max(1, settings["numSubSteps"])

    def _bury(self, roster: Roster) -> None:
        """Close the records of bodies that have gone without a hook seeing it."""
        codes = np.array(self._records.living, np.int64)
        gone = codes[rows_of(roster, codes) < 0]
        if len(gone):
            self.epoch += 1
            self._close(gone.tolist())

    def _end(self, bodies: Collection[int]) -> None:
        """Close the records of bodies."""
        self._close([code for code in self._records.living if code // LINK_SPAN in bodies])

    def _expose_impostors(self, now: Motion, dt: float) -> None:
        """Where nobody saw removals: what jumped and has another name, mass or inertia has taken over an old id."""
        for code in now.roster.code[jumped(self._past, now, dt)]:
            index = self._records.index_of(int(code))
            if index >= 0:
                known, seen = self._records.bodies[index], self._census.described(code, self.epoch)
                if seen is None:
                    continue
                same = known.mass_kg == seen.mass_kg and np.array_equal(known.inertia_kg_m2, seen.inertia_kg_m2)
                if not same or not np.array_equal(known.curvature_per_m, seen.curvature_per_m, equal_nan=True):
                    self.epoch += 1
                    self._close([int(code)])

    def _of_row(self, roster: Roster, meeting: Meetings) -> Array:
        """(n,) index into `bodies` of each row of the roster, -1 for who never met anybody; who meets the first time
        gets a silent record.
        """
        of_row = self._records.of_row(roster)
        met = np.unique(np.concatenate([meeting.row_a, meeting.row_b]))
        strangers = met[of_row[met] < 0]
        for code in roster.code[strangers]:
            record = self._census.described(code, self.epoch)
            if record is not None:
                self._append(int(code), replace(record, since_step=self.step_count))
        return self._records.of_row(roster) if len(strangers) else of_row

    def _append(self, code: int, record: Body) -> None:
        row = rows_of(self._past.roster, np.array([code]))[0]
        if row >= 0:
            self._records.append(code, record, self._past.position_m[row], self._past.quaternion_xyzw[row])
        else:
            self._records.append(code, record, np.zeros(3), np.array([0, 0, 0, 1.0]))

    def _close(self, codes: list[int]) -> None:
        self._records.close(codes, self.step_count)
