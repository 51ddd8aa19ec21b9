"""A PyBullet world as the sound needs it: bodies by value, and one `Step` for each physics step.

    before_step():  poses and twists                (with a hook; else those left by the previous step)
    stepSimulation
    after_step():   contacts, asked for once -> rows in body frames -> Step

Contact positions belong to the pose at the start of the step, so all rows use that pose. No row is made of: pairs
without force; islands asleep (speeds exactly 0, contacts bit-identical to the step before); a second poll without a
step between (everything bit-identical); a body moved by hand since the last step; the first step of a body created
inside another, where the position correction leaks into the impulse; and bodies that `left_out` names. One body whose
numbers break leaves the sound of the others as it is.
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

from sonic_bullet._engine import place_bodies
from sonic_bullet.records import Array, Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.records.step_tables import StepTables
from sonic_bullet.simulators.animated import rotation
from sonic_bullet.simulators.frames import LINK_SPAN, Motion, Roster, decode, encode, rows_of, same_motion, without_body
from sonic_bullet.simulators.known_bodies import KnownBodies, alike
from sonic_bullet.simulators.memory import Memory, room
from sonic_bullet.simulators.polling import NO_TOUCH, Touches, touches_of_rows
from sonic_bullet.simulators.properties import Properties
from sonic_bullet.simulators.pybullet import body_facts as facts
from sonic_bullet.simulators.pybullet import hooks
from sonic_bullet.simulators.pybullet.census import Census
from sonic_bullet.simulators.pybullet.left_out import BodiesLeftOut
from sonic_bullet.simulators.pybullet.poses import StateReader, check_connected, read_roster, undone
from sonic_bullet.simulators.pybullet.questions import (
    begin_usual,
    contact_points,
    end_usual,
    engine,
    settings,
    step_reader,
)
from sonic_bullet.simulators.pybullet.substep_motions import MotionsWithin, by_substep, substep_s
from sonic_bullet.simulators.pybullet.substeps import SubstepLog
from sonic_bullet.simulators.start import NOBODY, hooked_start, mark_jumped, polled_start

DRIVEN_M_S = 10.0
"""Speed up to which whatever is set step after step is driven (that of a body of mass 0: src/listener/step_start.cpp);
beyond it, only what goes on as it went."""


def weakly(method: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return what calls a bound method while its object lives, and does not keep that alive."""
    reference = weakref.WeakMethod(method)

    def call(argument: Any) -> None:
        living = reference()
        if living is not None:
            living(argument)

    return call


class PyBulletWorld(facts.AskedLinks):
    """A `World` that reads one client: its living bodies, their last poses, and the contacts of the last steps.

    Made by open_world.
    """

    def __init__(self, client: Any, client_id: int) -> None:
        # a weak reference: a client that is dropped has to disconnect
        self._client = weakref.ref(client) if hasattr(client, "__weakref__") else lambda: client
        self.client_id = client_id
        self._log = SubstepLog(client_id)
        self._uninstall: Callable[[], None] | None = None
        self._begin()

    def _begin(self) -> None:
        """Clear all state and read what the world holds before the first step."""
        self.epoch = self._step_count_then = 0
        self.stepped = False
        self._known = KnownBodies()
        self._added = facts.AddedLinks(self.client_id)
        self.properties = Properties(partial(facts.dynamics, self.client_id), partial(engine, self.client_id))
        self._memory_then = Memory()
        # weakly: a world that is dropped goes at once, with its models, not when the collector finds a cycle
        self._census = Census(self.client_id, weakly(self._bury), weakly(self._end))
        self._census.hooked = self._uninstall is not None
        self._reader = step_reader(self.client_id)
        self._settings = settings(self.client_id, self._reader, None)
        contact_points(self.client_id, self._reader, stepped=True)
        self._reader.forget_before()
        self._bound: tuple[Array, Array] | None = None  # tables of roster and traces that the reader has
        self._usual_of: StateReader | None = None  # what the reader takes usual steps by, None: it takes none
        self._begun = False  # whether it has read the begin of the coming one
        self._newest_in_reader = False  # whether it, and not the memory, has contacts and poses of the step before
        self._batch_body = self._known.body
        self._collected: list[StepTables] = []
        self._before: Motion | None = None
        self._moved: set[int] = set()
        self._set: set[int] = set()  # bodies whose pose was set since the last step, and before it
        self._set_before: set[int] = set()
        self._by_hand: set[int] = set()  # of those, the bodies that are driven
        self._within = MotionsWithin(self.client_id)
        self.newest_steps = 1
        self._log.close()
        if self._settings.substeps > 1:
            self._log.open()
        self._past = self._census.read()

    @property
    def client(self) -> Any:
        """The client that is read; None once it was dropped."""
        return self._client()

    @property
    def left_out(self) -> BodiesLeftOut:
        """The bodies left out, and the messages about them."""
        return self._census.left_out

    @property
    def untouched(self) -> frozenset[int]:
        """Ids of the bodies that were in the world at the last step and have had no contact yet."""
        return frozenset(body for body, _, _ in self._past.roster.bodies) - {body.body_id for body in self.living}

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages that say what of the world the sound leaves out, and why."""
        return tuple(self.left_out.notes)

    def _catch_up(self) -> None:
        """Count the usual steps that the reader has taken by itself; what was read before the last of them is past."""
        if self._usual_of is None:
            return
        steps, time_s, newest, state = self._reader.usual_steps()
        if steps:
            self._step_count_then += steps
            self._memory_then.time_s, self._memory_then.traces.newest = time_s, newest
            self._past_then = Motion(self._usual_of.roster, state)

    def _expect_unusual(self) -> None:
        """Take the next step by all that may have changed."""
        self._catch_up()
        if self._begun and self._usual_of is not None:
            self._before = Motion(self._usual_of.roster, self._reader.read_states)
        self._usual_of, self._begun = None, False

    @property
    def step_count(self) -> int:
        """Steps so far."""
        self._catch_up()
        return self._step_count_then

    @step_count.setter
    def step_count(self, count: int) -> None:
        self._expect_unusual()
        self._step_count_then = count

    @property
    def _memory(self) -> Memory:  # type: ignore[override]
        """Contacts and poses of the last steps."""
        self._catch_up()
        return self._memory_then

    @property
    def _past(self) -> Motion:
        """Poses and twists read before the last step; without hooks, after it."""
        self._catch_up()
        return self._past_then

    @_past.setter
    def _past(self, motion: Motion) -> None:
        self._expect_unusual()
        self._past_then = motion

    def listen(self, after: Callable[[], object]) -> bool:
        """Install hooks on the client's steps; False for the pybullet module or a client id, which have no instance."""
        if isinstance(self.client, numbers.Integral) or inspect.ismodule(self.client):
            return False
        self.hook(self.before_step, after)
        return True

    def settings_notes(self) -> tuple[str, ...]:
        """Return a line where bounces never end, by the settings made since hooks are there."""
        from sonic_bullet.simulators.pybullet.restitution import endless_bounces

        found = endless_bounces(self.client_id, self.properties.set_values)
        return tuple(f"{one.what}; {one.remedy}" for one in found)

    @property
    def has_bodies(self) -> bool:
        """Whether any body was in the world at the last step."""
        return bool(self._past.roster.bodies)

    def index_of(self, body: int, link: int = -1) -> int:
        """Return the index into `bodies` of the living record of a link, or -1."""
        return self._known.live.get(int(encode(body, link)), -1)

    def add(
        self,
        body: int,
        link: int = -1,
        *,
        material: Material | None = None,
        model: ModalModel | None = None,
        volume_m3: float | None = None,
        shapes: Sequence[Shape] = (),
        options: ModalOptions | None = None,
        mounting: str | float | None = None,
    ) -> Body:
        """Register a link with its material or model; return its record, which `bodies` holds from now on.

        A record that exists already (a silent partner, or an earlier add) ends with this step and a new one begins. A
        muted body is active again. Arguments: see `facts.added_body`. Raises SceneError for an unknown body or link, a
        soft body, a mass, pose or speed that cannot be, or a body that was created while a step was made.
        """
        check_connected(self.client_id)
        facts.check_exists(self.client_id, body, link)
        facts.check_usable(self.client_id, body)
        self._expect_unusual()
        code = int(encode(body, link))
        if self._before is not None and rows_of(self._before.roster, np.array([code]))[0] < 0:
            raise SceneError(f"body {body} came while a step was made", "create and add bodies between two steps")
        if body in self.left_out.muted:
            self.left_out.forget(body)
            self._census.stale()
        self._census.read()
        how: dict[str, Any] = {"material": material, "model": model, "volume_m3": volume_m3, "shapes": tuple(shapes)}
        how |= {"options": options, "mounting": mounting}
        record = replace(facts.added_body(self.client_id, body, link, self.epoch, **how), since_step=self.step_count)
        self._close([code])
        record = self._append(code, record)
        self._added.tell(code, how, record)
        return record

    def reset(self) -> None:
        """Restart with the links added, where they are still there: see `World.reset`.

        A body of the same id, name and shape is the same, as not every removal is observed. Values set stay known.
        Raises SceneError, having changed nothing: lost connection, called while a step is made, an absurd mass.
        """
        check_connected(self.client_id)
        self._expect_unusual()
        if self._before is not None:
            raise SceneError("reset was called while a step was made", "call it between two steps")
        added, before = self._added, self.properties
        there = added.still_there(read_roster(self.client_id))
        records = {
            code: added.record_anew(code, one, before.set_values.of(*decode(code))) for code, one in there.items()
        }
        self._begin()
        self.properties.set_values = before.set_values
        self._added.by_code = there
        before.names.hand_over(there, self.properties.names)
        for code in there:
            self._append(code, records[code])

    def forget(self, body: int | None = None) -> None:
        """Note that a body was removed (None: all, by resetSimulation); its id may be reused. Hooks call this."""
        self.epoch += 1
        self.left_out.forget(body)
        self._lose([code for code in self.properties.names.codes if body in (None, code // LINK_SPAN)])
        if body is None:
            self.emptied += 1
            self.mark_engine_changed()
            self._log.abandon()
            self._forget_touches()
            self._memory.forget()
        self._past = without_body(self._past, body)
        self._moved = {x for x in self._moved if body is not None and x != body}
        self._census.stale()

    def mark_moved(self, body: int | None) -> None:
        """Note that a body (None: every body) was moved by hand before the coming step."""
        self._census.note_move()
        if body is not None:
            self._set.add(body)
        self._moved.update([body] if body is not None else [entry[0] for entry in self._past.roster.bodies])

    def mark_changed(self, body: int, link: int) -> None:
        """Note that friction, mass and the like of a link may have changed: its static flag is read again."""
        self._census.stale()
        index = self.index_of(body, link)
        if index >= 0 and self.logged:
            self.properties.link_changed(int(encode(body, link)), index, self.step_count)

    def mark_engine_changed(self) -> None:
        """Note that settings of the engine may have changed."""
        if self.logged:
            self.properties.engine_changed(self.step_count)

    def hook(self, before: Callable[[], object], after: Callable[[], object]) -> None:
        """Call `before` and `after` around every stepSimulation of a BulletClient.

        `before` is, or calls, `before_step`. Raises SceneError for the pybullet module or a client id, which have no
        instance.
        """
        self.unhook()
        self._census.hooked = True
        self._census.stale()
        self.properties.set_values, self._uninstall = hooks.install(self, before, after)

    def unhook(self) -> None:
        """Restore the client's own functions and end the sub-step log; harmless when not hooked."""
        if self._uninstall is not None:
            self._uninstall()
            self._uninstall = None
            self._census.hooked = False
            self._census.stale()
        self._before = None
        self._expect_unusual()
        (self._log.abandon if self.client is None else self._log.close)()  # its id may be reused by now

    def before_step(self) -> None:
        """Read poses and twists at the start of the step; SceneError where the connection is lost."""
        usual = self._usual_of
        if usual is not None:
            if usual is self._census.reader and not self._moved and not self.felt and begin_usual(self._reader, usual):
                self._begun = True
                return
            self._expect_unusual()
        self._settings = settings(self.client_id, self._reader, self._settings)
        if self._settings.substeps > 1 and not self._log.is_open:
            self._log.open()
        self._before = self._census.read()

    def after_step(self) -> Step:
        """Return this step's record; call it once after each stepSimulation. A second call finds no contacts.

        `stepped` tells whether there was a step. Without a hook, a missing one is recognised by a world in motion that
        is where it was, to the bit; where nothing moves at all, a second call counts as a step. Raises SceneError: lost
        connection, sub-steps that cannot be read.
        """
        step = self._taken_in(apart=False)
        return self._waiting_step() if step is None else step

    def take_step(self) -> Step | None:
        """Take in the step just made: its record or, where its bodies are those before and no case is unusual, None.

        Then it waits to be `taken`. Where a step has sub-steps, each of them is a record, and the last of them is
        returned: two touches within a step are two events. See `after_step`.
        """
        return self._taken_in(apart=True)

    def _taken_in(self, *, apart: bool) -> Step | None:
        polled = False
        if self._begun:
            if self._usual_of is self._census.reader and not self._moved:
                if end_usual(self.client_id, self._reader):
                    self._begun, self.stepped, self._set_before, self.newest_steps = False, True, set(), 1
                    return None
                polled = True
            self._expect_unusual()
        before, self._before = self._before, None
        hooked = before is not None
        if before is None:
            self._settings = settings(self.client_id, self._reader, self._settings)
        self.stepped = self._uninstall is None or hooked
        if not self.stepped:
            return self._empty_step()
        touches = None if polled else self._poll(hooked)
        now = self._set_driven_speeds(before) if before is not None else self._census.read()
        step, self.newest_steps = None, 1
        if touches is not None and hooked and apart:
            return self._record_substeps(now, touches)
        if touches is not None and apart:
            self.left_out.say_once(
                f"numSubSteps is {self._settings.substeps}, and steps that are not hooked tell no poses between: what "
                "touches twice within a step is heard once; attach to a BulletClient"
            )
        if touches is not None or not self._usual(now, hooked):
            step = self._unusual(now, hooked, touches)
        elif self._batch_body is not self._known.body or self.felt:
            step = self._waiting_step()
        self._batch_body = self._known.body
        if self.stepped:
            self._past = now
            self._moved.clear()
            self.step_count += 1
            if hooked and step is None:
                self._expect_usual(now)
        return None if step is None else self.with_motions(step)

    def _record_substeps(self, now: Motion, touches: Touches) -> Step:
        """Make a record of each sub-step; return the last, while the others wait to be `taken`."""
        dt_s, count, gravity = self._settings
        h, memory = substep_s(dt_s, count), self._memory
        parts = by_substep(self._census.usable(touches), count, h)
        self._remember()
        self._collect()
        first = self.step_count == 0
        if first:
            self.properties.first_step()
        motions = self._within.read(now, self._census.read(), parts, h, np.array(gravity), self._by_hand)
        fixed, silent = now.roster.static, partial(self._census.describe, epoch=self.epoch)
        begin = hooked_start(None if first else self._past, now, self._moved, dt_s)
        for k, (motion, part) in enumerate(zip(motions, parts, strict=True)):
            start = begin
            if k:
                start = hooked_start(motions[k - 1], motion, (), h)
                for name in ("velocity_m_s", "spin_rad_s"):  # a static body that is driven stays and has its speed
                    start[name][fixed] = begin[name][fixed]
            past, memory.touches = memory.touches, part
            row, made = self._rows(start, part, past, h, silent)
            step = memory.unusual(self._known, start, row, made, h, gravity)
            if k < count - 1:
                self._collected.append(StepTables.of([step]))
            self.step_count += 1
        self._past, self._batch_body, self.newest_steps = now, self._known.body, count
        self._moved.clear()
        return self.with_motions(step)

    def _set_driven_speeds(self, now: Motion) -> Motion:
        """Give bodies whose poses are set step after step the speeds of these poses: they are driven, and do not jump.

        What is set somewhere else each time, faster than anything is driven and not on the way that it had, jumps.
        """
        again, self._set_before, self._set = self._set & self._set_before, self._set, set()
        self._by_hand = set()
        if not again or not self.driven_contacts:
            return now
        past, dt_s = self._past, self._settings.dt_s
        which = np.flatnonzero(np.isin(now.roster.code // LINK_SPAN, list(again)) & ~now.roster.static)
        old = rows_of(past.roster, now.roster.code[which])
        which, old = which[old >= 0], old[old >= 0]
        velocity, before = (now.position_m[which] - past.position_m[old]) / dt_s, past.velocity_m_s[old]
        speed, speed_before = np.linalg.norm(velocity, axis=1), np.linalg.norm(before, axis=1)
        on_its_way = np.linalg.norm(velocity - before, axis=1) <= 0.5 * (speed + speed_before)
        jumping = set((now.roster.code[which[(speed > DRIVEN_M_S) & ~on_its_way]] // LINK_SPAN).tolist())
        keep = ~np.isin(now.roster.code[which] // LINK_SPAN, list(jumping))
        which, old = which[keep], old[keep]
        row = now.row.copy()
        row["velocity_m_s"][which] = velocity[keep]
        row["spin_rad_s"][which] = rotation(past.quaternion_xyzw[old], now.quaternion_xyzw[which]) / dt_s
        self._by_hand = again - jumping
        self._moved -= self._by_hand
        return replace(now, row=row)

    def _expect_usual(self, now: Motion) -> None:
        """Let the reader take the next steps by itself, while nothing but the simulation itself changes anything."""
        states, memory = self._census.reader, self._memory
        if states is not None and states.roster is now.roster and self._uninstall is not None:
            self._reader.expect_usual(
                now.row, memory.time_s, memory.traces.newest, pybullet.getNumBodies, now.roster.count
            )
            self._usual_of = states

    def take_waiting(self) -> list[StepTables]:
        """Return the steps that waited, which were made before the last record was; none of them waits any more."""
        self._collect()
        collected, self._collected = self._collected, []
        return collected

    @property
    def waiting(self) -> int:  # type: ignore[override]
        """Contacts of the steps that wait to be `taken`."""
        return self._reader.waiting_contacts

    def _collect(self) -> None:
        """Take the steps that wait out of the reader."""
        if not self._reader.waiting:
            return
        step, contact, position, quaternion, teleported = self._reader.taken()
        dt_s, gravity_m_s2 = tuple(step["dt_s"].tolist()), np.ascontiguousarray(step["gravity_m_s2"])
        ends = tuple(step["contact_end"].tolist())
        self._collected.append(
            StepTables(dt_s, gravity_m_s2, contact, ends, position, quaternion, teleported, self._reader_body)
        )

    def _waiting_step(self) -> Step:
        """Return the record of the last step that waits, which waits no more."""
        self._collect()
        last = self._collected.pop()
        if len(last) > 1:
            self._collected.append(last.part(0, len(last) - 1))
        return last.step(-1)

    def _empty_step(self) -> Step:
        """Return a step in which nothing happened."""
        self._remember()
        return self._memory.empty_step(self._settings.dt_s, self._settings.gravity_m_s2)

    def _remember(self) -> None:
        """Bring contacts and poses of the step before into the memory, where the reader has them."""
        if self._newest_in_reader and self._bound is not None:
            poses = room(len(self._reader_body))
            place_bodies(self._bound[0], *poses)
            self._memory.poses = poses, self._reader_body
            self._memory.touches, self._newest_in_reader = Touches(self._reader.loaded), False

    def _forget_touches(self) -> None:
        """Drop the contacts of the step before."""
        self._remember()
        self._memory.touches = None

    def _poll(self, hooked: bool) -> Touches | None:
        """Poll this step's contacts, once: the reader keeps them, or those of sub-steps are returned."""
        last = contact_points(self.client_id, self._reader, stepped=hooked)
        if self._settings.substeps > 1:
            return self._log.touches(last, self._settings.dt_s, self._settings.substeps)
        if self._log.is_open:
            self._log.close()
        return None

    def _usual(self, now: Motion, hooked: bool) -> bool:
        """Add the step to those that wait where no body came, went or is left out and no case is unusual."""
        left_out, known, memory, reader = self.left_out, self._known, self._memory, self._reader
        if now.roster is not self._past.roster or not self.step_count or left_out.muted or left_out.soft:
            return False
        start, traces = known.start(now.roster), memory.traces
        traces.reserve(reader.count)
        if self._bound is None or self._bound[0] is not start or self._bound[1] is not traces.table:
            self._collect()
            reader.bind(traces, start, len(known.body))
            self._bound, self._reader_body = (start, traces.table), known.body
        if not self._newest_in_reader:
            reader.set_loaded(NO_TOUCH if memory.touches is None else memory.touches.row)
        by_hand = np.array(sorted(self._moved), np.int64) if self._moved and hooked else NOBODY
        dt, _, gravity = self._settings
        memory.check(dt, gravity)
        made = reader.take(self._past.row, now.row, by_hand, hooked, dt, gravity, memory.time_s, traces.newest)
        if made < 0:
            return False
        self._newest_in_reader = True
        memory.turn(dt)
        return True

    def _unusual(self, now: Motion, hooked: bool, touches: Touches | None) -> Step:
        """Return any step; touches: of sub-steps, else those of the memory."""
        memory, (dt, _, gravity) = self._memory, self._settings
        self._remember()
        first, past_touches = self.step_count == 0, memory.touches
        if first:
            self.properties.first_step()
        reader = self._reader
        touches = self._census.usable(
            touches_of_rows(reader.reported, reader.reported_before, dt) if touches is None else touches
        )
        if hooked:
            start = hooked_start(None if first else self._past, now, self._moved, dt)
        else:
            frozen = not first and same_motion(self._past, now)
            if frozen and now.would_move(dt) and past_touches is not None and touches.equals(past_touches):
                self.stepped = False
                return memory.empty_step(dt, gravity)
            self._expose_impostors(now, dt)
            start = polled_start(
                self._past, now, touches, dt, undo=partial(undone, client_id=self.client_id), first=first
            )
        memory.touches, self._past = touches, now
        silent = partial(self._census.describe, epoch=self.epoch)
        row, made = self._rows(start, touches, past_touches, dt, silent)
        return memory.unusual(self._known, start, row, made, dt, gravity)

    def _bury(self, roster: Roster) -> None:
        """Close the records of bodies that were removed without a hook observing it."""
        gone = self._known.gone(roster)
        if gone:
            self.epoch += 1
            self._lose(gone)

    def _end(self, bodies: Collection[int]) -> None:
        """Close the records of bodies that are left out from now on."""
        self._expect_unusual()
        self._close([code for code in self._known.live if code // LINK_SPAN in bodies])

    def _expose_impostors(self, now: Motion, dt: float) -> None:
        """Close records, without hooks, of links that jumped and changed name, mass or inertia: their id was reused."""
        for code in now.roster.code[mark_jumped(self._past, now, dt)].tolist():
            before = self._known.records.get(self._known.live.get(code, -1))
            seen = None if before is None else self._census.describe(code, self.epoch)
            if before is not None and seen is not None and not alike(before, seen):
                self.epoch += 1
                self._lose([code])

    def _lose(self, codes: Collection[int]) -> None:
        """End the records and free the names of links that are gone."""
        self._expect_unusual()
        self._close(codes)
        self._added.forget(codes)
        self.properties.names.forget(codes)
