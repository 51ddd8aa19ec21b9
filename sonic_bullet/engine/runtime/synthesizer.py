"""Run time: physics steps in, frames of sound out, with one explicit state between (synthesis_state.py).

    Step, Step, … -> STEP table -> engine's advance_steps, enlarging tables where it asks for it -> frames
                                        + grains of residuals, where a body has one: then a step at a time

A step's sound is made when the `LOOKAHEAD` steps after it are known. Live listening, `sound` (which drains a copy of
the state) and the replay of a log run the same code on the same numbers in the same order: the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from struct import Struct

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.engine.bank.rigid_motion import enter_mobility, until_motions
from sonic_bullet.engine.contact.load_splitting import LOOKAHEAD
from sonic_bullet.engine.path import propagation
from sonic_bullet.engine.path.room.room_plan import RoomPlan
from sonic_bullet.engine.path.space.space_state import hears_apart
from sonic_bullet.engine.runtime.body_lifetime import Records, admit, in_tables, release, sum_separations
from sonic_bullet.engine.runtime.body_substitution import substitute
from sonic_bullet.engine.runtime.channels.body_images import complete_setup
from sonic_bullet.engine.runtime.channels.directional_weights import take_aim, until_turned
from sonic_bullet.engine.runtime.channels.finished_channels import finish_channels
from sonic_bullet.engine.runtime.clock import Clock, exact_step
from sonic_bullet.engine.runtime.residual_voice import add_residuals
from sonic_bullet.engine.runtime.ringing_on import with_tail
from sonic_bullet.engine.runtime.synthesis_state import Setup, State, quench, start
from sonic_bullet.files.storage.spooled_sound import KeptSound, SoundSpool
from sonic_bullet.records import Air, Array, Body, Sensor
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError, FileError
from sonic_bullet.records.step_tables import Steps, StepTables, as_tables
from sonic_bullet.records.touching.link_motions import NO_MOTIONS

LATENCY_STEPS = LOOKAHEAD
STEP_LAYOUT = Struct("4d4q3dq")
"""STEP, field by field: packing a row so is ten times as fast as setting its fields."""
assert STEP_LAYOUT.size == _engine.STEP.itemsize
LOOK_EVERY = 64
"""Steps between two checks for bodies that have left and are silent: a check costs 20 µs, so that it and the removal of
a body cost nothing, and tables hold at most what left in so many steps beside what still rings."""


def advance(setup: Setup, state: State, given: Steps) -> Array:
    """Take in steps of the bodies present; return (channels, n) of what can be rendered then, LOOKAHEAD before them.

    Changes ``state`` in place: `copy` it first to come back to it.
    """
    steps = as_tables(given)
    if len(steps) == 1 and not state.quenches:  # live, where a microsecond counts
        return _advance_steps(setup, state, steps)
    frames = []
    while len(steps):
        if state.number in state.quenches and len(state.waiting) == LOOKAHEAD:
            quench(state)
        count = 1 if state.has_residual or state.observer is not None else len(steps)
        ahead = [q - state.number for q in state.quenches if q > state.number]  # the next group begins there
        count = min([count, *(q + LOOKAHEAD - len(state.waiting) for q in ahead), until_motions(steps)])
        count = min(count, until_turned(setup, state, steps.part(0, count)))
        frames.append(_advance_steps(setup, state, steps.part(0, count)))
        steps = steps.part(count, len(steps))
    return np.concatenate(frames, axis=1) if len(frames) != 1 else frames[0]


def _schedule(sr: int, state: State, steps: StepTables) -> tuple[Array, Clock, tuple[float, ...]]:
    """Build the STEP table of steps to be taken in, and clock and waiting lengths after them."""
    layout, clock, number, at = STEP_LAYOUT, state.clock, state.number, 0
    table = bytearray(len(steps) * layout.size)
    lengths_s = (*state.waiting, *steps.dt_s)
    rendered = len(state.waiting) - LOOKAHEAD  # which of `lengths_s` the step before the next one renders
    sample = clock.sample(sr)
    gravity_m_s2 = steps.gravity_m_s2.tolist()
    for i, (dt_s, end) in enumerate(zip(steps.dt_s, steps.contact_end, strict=True)):
        count, offset, begin_s, after_s, quenched = 0, 0.0, 0.0, 0.0, False
        rendered += 1
        first = sample
        if rendered > 0:
            number += 1
            after = clock.after(lengths_s[rendered - 1])
            offset, begin_s, after_s, quenched = clock.offset(sr), clock.time_s, after.time_s, number in state.quenches
            sample, clock = after.sample(sr), after
            count = sample - first
        layout.pack_into(
            table, i * layout.size, dt_s, *gravity_m_s2[i], at, end, first, count, offset, begin_s, after_s, quenched
        )
        at = end
    waiting = lengths_s[max(rendered, 0) :]
    return np.frombuffer(table, _engine.STEP), clock, waiting


def _advance_steps(setup: Setup, state: State, steps: StepTables) -> Array:
    """Advance by steps without a quench between; by one alone where a body has a residual."""
    sr, begin, pause = setup.sr, state.ringing.at, state.has_residual or state.observer is not None
    enter_mobility(state.table.bodies, state.body, steps.motions[0] if steps.motions else NO_MOTIONS)
    table, clock, waiting = _schedule(sr, state, steps)
    contacts = steps.contact
    poses: tuple[Array, ...] = steps.position_m, steps.quaternion_xyzw, steps.teleported
    if state.present is not state.body or state.mapped:
        contacts, poses = in_tables(state, contacts, poses)
    stop = clock.sample(sr)
    aim, sensors = propagation.AT_REST, len(state.reads)
    by_body = setup.apart or hears_apart(setup.sensors) or state.surface is not None
    if state.space is not None:
        aim = state.space.aim(table, clock.after(waiting[0]).time_s, poses, state.resonators)
    take_aim(setup, state)
    groups, microphones = len(state.body) if by_body else 1, len(state.path.microphone_m)
    out = np.zeros((groups * sensors, stop - begin))
    pressure = out if microphones == sensors else np.zeros((groups * microphones, stop - begin))
    longest = int(table["count"].max()) if len(steps) > 1 else stop - begin
    if state.scratch.samples < longest:
        _make_room(state, table[0], longest)
    done, resume = 0, _engine.STEP_NEW
    while done < len(steps):
        more, status = state.engine().advance_steps(
            done, state.taken, pause, resume, float(sr), table, contacts, poses[0], poses[1], poses[2],
            aim, begin, by_body, state.reads,
            state.sets, pressure, out,
        )  # fmt: skip
        again = status in (_engine.TABLE_SHORT, _engine.STEPS_DONE)
        done, resume = done + more, _engine.STEP_NEW if again else _engine.STEP_RINGS
        if status == _engine.STEPS_DONE:
            continue
        if status == _engine.TABLE_SHORT:
            _make_room(state, table[done], longest)
        elif status == _engine.PAUSED:
            found, drives = state.scratch.count.tolist()
            if state.has_residual:
                add_residuals(setup, state, table[done], found, drives)
            if state.observer is not None:
                state.observer(state, state.taken + done - LOOKAHEAD, table[done], found, drives)
        elif status == _engine.BROKEN:
            what = "the synthesizer made NaN or infinite samples, or lost a strike"
            raise AudioError(what, "report the contact log: this must not happen")
        else:
            state.travelling.at = int(table[done]["sample"])
            propagation.grow(state.path, state.travelling, status)
            state.mark_changed()
    state.taken += len(steps)
    state.clock, state.waiting = clock, waiting
    state.ringing.at = state.travelling.at = stop
    return finish_channels(setup, state, table, steps, out, pressure)


def _make_room(state: State, step: Array, samples: int) -> None:
    """Make room for the step: its rows, the pairs and the strikes that they may become."""
    rows = int(step["row"][1] - step["row"][0])
    pairs = int(state.pairs.count[0]) + rows
    columns = state.bank.columns
    state.window.with_room(rows)
    state.pairs.with_room(rows, columns)
    state.ringing.with_room(4 * pairs)
    state.scratch.fit(pairs, columns, samples, state.bank.observed.shape)
    state.mark_changed()


def drain_steps(setup: Setup, state: State, last: Step | None) -> Array:
    """Render the steps taken in but not yet rendered, (channels, n), as if nothing touched any more afterwards.

    last: the newest of them. ``state`` is not changed.
    """
    missing = len(state.waiting)
    if last is None or not missing:
        return np.zeros((setup.channels * (len(state.body) if setup.apart else 1), 0))
    state = state.copy()
    count = clock_after(state).sample(setup.sr) - state.clock.sample(setup.sr)
    still = replace(last, contacts=Contacts.none(), teleported=np.zeros(len(last.teleported), bool))
    return advance(setup, state, [still] * LOOKAHEAD)[:, :count]


def clock_after(state: State) -> Clock:
    """Return the clock at the end of the last step taken in."""
    clock = state.clock
    for dt_s in state.waiting:
        clock = clock.after(dt_s)
    return clock


class Synthesizer:
    """Live form of `advance`: steps in, lagging frames out; the sound so far is kept, unless ``keep`` is False.

    unkept: why no more of it is kept, once a disk is full; frames continue. newest_samples: of the frame of the step
    taken in last.
    """

    def __init__(
        self, *, sr: int, sensors: tuple[Sensor, ...], seed: int, air: Air, residual: bool = True,
        supports: bool = True, image: bool = False, room: RoomPlan | None = None, keep: bool = True,
    ) -> None:  # fmt: skip
        setup = Setup(sr, sensors, seed, air, residual=residual, supports=supports, room=room)
        self._setup = complete_setup(setup, image=image)
        self._keep = keep
        self.reset()

    def reset(self) -> None:
        """Begin anew at time 0, in silence, as one just made."""
        self._state = start(self._setup)
        self._clock = Clock()
        self._sound = SoundSpool(self._setup.channels, "attach with keep_sound=False") if self._keep else None
        self.unkept: FileError | None = None
        self._lag = np.zeros((self._setup.channels, 0))
        self._newest: StepTables | None = None  # the steps taken in last
        self._failed: AudioError | None = None
        self._steps = 0
        self._looked = 0
        self.newest_samples = 0

    @property
    def time_s(self) -> float:
        """Physics time taken in."""
        return self._clock.time_s

    @property
    def separations(self) -> dict[str, tuple[int, int]]:
        """Steps with contact separation, see `body_lifetime.sum_separations`."""
        return sum_separations(self._state)

    def newest(self, steps: int, dt_s: float) -> int:
        """Return the samples of the frames of the last so many steps of that length."""
        return self._clock.sample(self._setup.sr) - self._clock.after(dt_s, -steps).sample(self._setup.sr)

    def feed(self, step: Step, bodies: Records) -> Array:
        """Take in a step; return the frame (channels, n) as long as the step, LATENCY_STEPS late.

        bodies: by index, at least those new in the step. Without a sensor nothing is computed but the time. Raises
        LogError where a body comes that had left.
        """
        return self.feed_all(StepTables.of([step]), bodies)

    def feed_all(self, given: Steps, bodies: Records) -> Array:
        """Take in steps of the same bodies each; return what `feed` gives for each of them, joined."""
        steps = as_tables(given)
        if len({*self._state.waiting, *steps.dt_s}) > 1 and len(steps) > 1:  # a frame that grows may have to wait
            return np.concatenate([self.feed_all(steps.part(i, i + 1), bodies) for i in range(len(steps))], axis=1)
        channels, sr, rendered = self._setup.channels, self._setup.sr, len(self._state.waiting) == LATENCY_STEPS
        begin, before_first, first = self._clock.sample(sr), LATENCY_STEPS - len(self._state.waiting), self._steps == 0
        dt_s, number = steps.dt_s[0], len(steps)  # of one length
        silent = self._clock.after(dt_s, min(before_first, number)).sample(sr) - begin
        self._clock, newest = self._clock.after(dt_s, number), self._clock.after(dt_s, number - 1)
        self.newest_samples = self._clock.sample(sr) - newest.sample(sr)
        count = self._clock.sample(sr) - begin
        self._steps += len(steps)
        if channels == 0:
            return np.zeros((0, count))
        fresh = self._take(steps, bodies)
        if not rendered:
            # where a step is no whole number of samples (44.1 kHz at 240 Hz), one more, so that uneven frames never run
            # dry
            uneven = (exact_step(steps.dt_s[0]) * sr).denominator != 1
            fresh = np.concatenate([np.zeros((channels, silent + (uneven and first))), fresh], axis=1)
        if self._lag.shape[1] == 0 and fresh.shape[1] == count:
            return fresh
        queue = np.concatenate([self._lag, fresh], axis=1)
        if rendered and queue.shape[1] < count:  # the step grew, and with it the lag in samples
            queue = np.concatenate([np.zeros((channels, count - queue.shape[1])), queue], axis=1)
        out, self._lag = queue[:, :count], queue[:, count:]
        return np.ascontiguousarray(out)

    def play(self, given: Steps, bodies: Records) -> Array:
        """Take in steps of the same bodies each; return (channels, n) of what can be rendered then, without lag."""
        steps = as_tables(given)
        for dt_s in steps.dt_s:
            self._clock = self._clock.after(dt_s)
        self._steps += len(steps)
        return self._take(steps, bodies) if self._setup.sensors else np.zeros((0, 0))

    def _take(self, steps: StepTables, bodies: Records) -> Array:
        if self._failed is not None:  # it failed within a step: the state cannot be continued
            raise self._failed
        state = self._state
        if steps.body is not state.present:
            admit(self._setup, state, steps.step(0), bodies)
        try:
            frame = advance(self._setup, state, steps)
        except AudioError as error:
            self._failed = error
            raise
        if state.present is not state.body and state.taken >= self._looked + LOOK_EVERY:
            self._looked = state.taken
            release(state)
        self._newest = steps
        if self._sound is not None and self.unkept is None:
            try:
                self._sound.add(frame)
            except FileError as error:
                self.unkept = error
        return frame

    @property
    def _last(self) -> Step | None:
        """The step taken in last."""
        return None if self._newest is None else self._newest.step(-1)

    def rest(self) -> Array:
        """Render the rest of the steps taken in, (channels, n), as if nothing touched any more."""
        channels = self._setup.channels
        if not channels:
            return np.zeros((0, self._clock.sample(self._setup.sr)))
        return drain_steps(self._setup, self._state, self._last) if self._failed is None else np.zeros((channels, 0))

    def sound(self) -> Array:
        """Return all sound so far, (channels, floor(sr·time)), without lag; as `kept_sound`, in memory."""
        return self.kept_sound().samples()

    def kept_sound(self, tail_db: float | None = None) -> KeptSound:
        """Return all sound so far, without lag, where it is stored.

        After an AudioError: what was made before it; after a full disk: what was kept. tail_db: see `with_tail`. Raises
        AudioError where none is kept.
        """
        if self._sound is None:
            raise AudioError("the sound is not kept", "attach with keep_sound=True, or read() the frames")
        rest = self.rest() if self.unkept is None else np.zeros((self._setup.channels, 0))
        sound = KeptSound(self._sound, len(self._sound), rest)
        return sound if self.unkept is not None else self.with_tail(sound, tail_db)

    def with_tail(self, sound: KeptSound, tail_db: float | None, longer_s: float = 0.0) -> KeptSound:
        """Extend the whole sound so far by its tail until it is tail_db below its peak; None: nothing more.

        longer_s: by so much more.
        """
        if tail_db is None or self._failed is not None:
            return sound
        return with_tail(sound, self._setup, self._state, self._last, tail_db, longer_s)

    def substitute(self, bodies: Mapping[int, Body]) -> None:
        """Give bodies that nothing has touched yet, by their index, the models that they have now."""
        if self._setup.sensors:
            substitute(self._setup, self._state, bodies)

    def quench(self) -> None:
        """Stop all ringing where the steps taken in so far end, exactly there at any rate.

        In frames that is LATENCY_STEPS later.
        """
        if self._setup.sensors:
            self._state.quenches = self._state.quenches | {self._steps}
