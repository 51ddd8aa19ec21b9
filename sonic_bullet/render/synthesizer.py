"""The run time: physics steps in, frames of sound out, with one explicit state between.

    Step -> loads (synth.strikes) -> impacts, friction -> bank of modes and of rigid motions (synth.bank) + residual ->
        sound path (synth.path) -> frame

Each body is one of the bank's: its modes, behind them the lines of its residual (see residual_voice.py), and its three
translations (see resonator.py).

A step's sound is made when the `LOOKAHEAD` steps after it are known. Live listening, `sound` (which drains a copy of
the state) and the replay of a log run the same code on the same numbers in the same order: the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet.records import Air, Array, Body, Microphone, Sensor
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError
from sonic_bullet.render.clock import Clock, exact_step
from sonic_bullet.render.friction_voice import Drive, FrictionVoice, advance_friction
from sonic_bullet.render.impacts import ForcePulse, find_pulses
from sonic_bullet.render.manifold import Rows, orient
from sonic_bullet.render.residual_voice import (
    ResidualVoice,
    Rubs,
    build_residual_voice,
    friction_grains,
    impact_grains,
)
from sonic_bullet.render.resonator import Resonator, build_resonator, weight_sets
from sonic_bullet.residual.player import Grain, add_grains
from sonic_bullet.synth import bank, path
from sonic_bullet.synth.bank import Bank, BankState
from sonic_bullet.synth.path import Path, PathState
from sonic_bullet.synth.strikes import LOOKAHEAD, SPAN, LoadHistory, push, split

LATENCY_STEPS = LOOKAHEAD


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What does not change while listening: rate in Hz, sensors (a channel each), seed and medium;

    residual: whether those of materials are heard.
    """

    sr: int
    sensors: tuple[Sensor, ...]
    seed: int
    air: Air
    residual: bool = True

    @property
    def microphone_m(self) -> Array:
        """(c, 3) places of the microphones among the sensors."""
        return np.array([s.position_m for s in self.sensors if isinstance(s, Microphone)]).reshape(-1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """All that the next frame hangs on. number: of the step to be rendered next; window: that step and those known
    after it, rows: their contacts. placed (b,): step in which each body began or was last moved by hand. quenches:
    steps before which all is to stop ringing. voices (b): their residuals; grains, rubs: what of those is under way.
    """

    number: int
    clock: Clock
    window: tuple[Step, ...]
    rows: tuple[Rows, ...]
    loads: LoadHistory
    resonators: tuple[Resonator, ...]
    bank: Bank
    ringing: BankState
    path: Path
    travelling: PathState
    friction: FrictionVoice
    placed: Array
    voices: tuple[ResidualVoice | None, ...] = ()
    grains: tuple[Grain, ...] = ()
    rubs: Rubs = field(default_factory=dict)
    quenches: frozenset[int] = frozenset()


def start(setup: Setup) -> State:
    """Silence at time 0, nobody there."""
    instrument, ringing = bank.empty_bank(setup.sr, 1 + len(weight_sets(setup.sensors)))
    air, travelling = path.empty_path(setup.sr, setup.air, setup.microphone_m)
    return State(
        0,
        Clock(),
        (),
        (),
        LoadHistory.empty(),
        (),
        instrument,
        ringing,
        air,
        travelling,
        FrictionVoice.none(),
        np.zeros(0, np.int64),
    )


def with_bodies(setup: Setup, state: State, bodies: Sequence[Body]) -> State:
    """The state with further bodies, silent at first."""
    if not bodies:
        return state
    new = tuple(build_resonator(body, setup.sensors, setup.sr, setup.air) for body in bodies)
    voices = tuple(build_residual_voice(s, setup.sr, setup.air) if setup.residual else None for s in new)
    modes = [_mode_set(s, more) for s, more in zip(new, voices, strict=True)]
    instrument, ringing = bank.append(state.bank, state.ringing, modes)
    air, travelling = path.append_bodies(state.path, state.travelling, *_places(new))
    # a silent partner's record begins where it first touches, not where it was put
    placed = np.concatenate(
        [state.placed, [body.since_step if body.material is not None else -SPAN for body in bodies]]
    ).astype(np.int64)
    resonators, both = state.resonators + new, state.voices + voices
    return replace(
        state,
        placed=placed,
        resonators=resonators,
        voices=both,
        bank=instrument,
        ringing=ringing,
        path=air,
        travelling=travelling,
    )


def _places(resonators: tuple[Resonator, ...]) -> tuple[Array, Array]:
    """Radius and jerk coefficient for the path: the bank has turned pushes into Pa·m already."""
    return np.array([s.radius_m for s in resonators]), np.ones(len(resonators))


def _mode_set(s: Resonator, more: ResidualVoice | None) -> bank.ModeSet:
    """A body as the bank takes it: its modes, and the lines of its residual behind them."""
    own = bank.ModeSet(
        s.omega_rad_s, s.decay_per_s, s.weight, s.bend, s.damping_growth, s.damping_growth_power, s.rigid
    )
    if more is None:
        return own
    lines = more.lines
    bend, damping_growth = (
        None if x is None or y is None else np.concatenate([x, y])
        for x, y in ((s.bend, lines.bend), (s.damping_growth, lines.damping_growth))
    )
    return replace(
        own,
        omega_rad_s=np.concatenate([s.omega_rad_s, lines.omega_rad_s]),
        decay_per_s=np.concatenate([s.decay_per_s, lines.decay_per_s]),
        weight=np.concatenate([s.weight, lines.weight], axis=1),
        bend=bend,
        damping_growth=damping_growth,
    )


def _columns(gain: Array, more: ResidualVoice | None) -> Array:
    """A gain of each mode, and of each line that of the mode it follows."""
    return gain if more is None else np.concatenate([gain, gain[more.follows]])


def take_step(setup: Setup, state: State, step: Step) -> tuple[Array | None, State]:
    """Take in one step; the frame (channels, n) of the step LOOKAHEAD before it, or None while too few are known.

    The bank's and the path's arrays change in place: `copied` a state first to come back to it.
    """
    state = replace(
        state,
        window=(*state.window, step),
        rows=(*state.rows, orient(step)),
        loads=push(state.loads, step.contacts, step.dt_s),
    )
    if len(state.window) <= LOOKAHEAD:
        return None, state
    frame, state = _render(setup, state)
    return frame, replace(state, window=state.window[1:], rows=state.rows[1:])


def copied(state: State) -> State:
    """A state of its own: advancing one leaves the other."""
    return replace(state, ringing=state.ringing.copy(), travelling=state.travelling.copy())


def drained(setup: Setup, state: State) -> Array:
    """(channels, n) sound of the steps taken in but not yet rendered, as if nothing touched any more afterwards.

    ``state`` stays.
    """
    state = copied(state)
    frames = [np.zeros((len(setup.sensors), 0))]
    missing = len(state.window)
    for _ in range(LOOKAHEAD if missing else 0):
        last = state.window[-1]
        frame, state = take_step(
            setup, state, replace(last, contacts=Contacts.none(), teleported=np.zeros(len(last.teleported), bool))
        )
        if frame is not None and len(frames) <= missing:
            frames.append(frame)
    return np.concatenate(frames, axis=1)


def quenched(state: State) -> State:
    """Nothing rings from the next sample on; strikes under way and the sound still travelling to the microphones are
    gone too.

    Loads, and what rubs, stay: a ball that rolls rolls on.
    """
    air, travelling = path.empty_path(state.path.sr, state.path.air, state.path.microphone_m, state.travelling.at)
    air, travelling = path.append_bodies(air, travelling, *_places(state.resonators))
    still_to_come = frozenset(number for number in state.quenches if number > state.number)
    return replace(
        state,
        ringing=bank.silence(state.ringing),
        path=air,
        travelling=travelling,
        grains=(),
        rubs={},
        quenches=still_to_come,
    )


def _render(setup: Setup, state: State) -> tuple[Array, State]:
    """The frame of window[0]."""
    if state.number in state.quenches:
        state = quenched(state)
    window, rows, resonators, clock, sr = state.window, state.rows, state.resonators, state.clock, setup.sr
    step = window[0]
    after = clock.after(step.dt_s)
    count = after.sample(sr) - clock.sample(sr)
    x = clock.progress(step.dt_s, sr, count)
    placed = state.placed.copy()
    moved = np.flatnonzero(window[1].teleported)
    placed[moved] = state.number + 1
    parts, loads = split(state.loads, ahead=0)  # of the first step, and what was not sure a step ago
    pulses = [
        (float(clock.time_s), pulse)
        for pulse in find_pulses(parts, rows, step, resonators, state.number - placed < SPAN, 0.0)
    ]
    parts, marked = split(loads)
    # else what strikes after the quench would be dated back before it, and be lost: it waits for its own step
    if state.number + 1 not in state.quenches:
        loads = marked
        pulses += [
            (float(after.time_s), pulse)
            for pulse in find_pulses(
                parts, rows[1:], window[1], resonators, state.number + 1 - placed < SPAN, -step.dt_s
            )
        ]
    drives, friction = advance_friction(state.friction, parts, step, window[1], rows[1], resonators, x, sr, setup.seed)
    first, voices = clock.sample(sr), state.voices
    strikes = [strike for begin_s, pulse in pulses for strike in _strikes(pulse, begin_s, voices, sr, first)]
    pushed = np.zeros((len(resonators), 3, count))
    sound = bank.advance(state.bank, state.ringing, count, strikes, _forces(drives, voices), x, pushed)
    more, rubs = friction_grains(state.rubs, drives, resonators, voices, first, count, setup.seed)
    grains = (
        *state.grains,
        *(
            g
            for begin_s, pulse in pulses
            for g in impact_grains(pulse, begin_s, resonators, voices, sr, first, setup.seed)
        ),
        *more,
    )
    grains = add_grains(sound, grains, first)
    frame = _at_sensors(setup, state, sound, pushed, x)
    return frame, replace(
        state,
        number=state.number + 1,
        clock=after,
        loads=loads,
        friction=friction,
        placed=placed,
        grains=grains,
        rubs=rubs,
    )


def _strikes(
    pulse: ForcePulse, step_start_s: float, voices: tuple[ResidualVoice | None, ...], sr: int, earliest: int
) -> list[bank.Strike]:
    """The pulse on both bodies."""
    start = max((step_start_s + pulse.start_s) * sr, float(earliest))
    sides = (pulse.low, pulse.modes_low, pulse.impulse_n_s), (pulse.high, pulse.modes_high, -pulse.impulse_n_s)
    return [
        bank.Strike(
            body,
            start,
            pulse.length_s,
            _columns(pulse.share * modes, voices[body]),
            pulse.flat,
            pulse.share * shove,
        )
        for body, modes, shove in sides
    ]


def _forces(drives: Sequence[Drive], voices: tuple[ResidualVoice | None, ...]) -> list[bank.Force]:
    """Drives on both bodies, each with its own gains."""
    return [
        bank.Force(
            body,
            drive.force_n,
            _columns(drive.gain0[side], voices[body]),
            _columns(drive.gain1[side], voices[body]),
            sign * drive.direction0,
            sign * drive.direction1,
        )
        for drive in drives
        for side, (body, sign) in enumerate(((drive.low, 1.0), (drive.high, -1.0)))
    ]


def _at_sensors(setup: Setup, state: State, modal: Array, pushed: Array, x: Array) -> Array:
    """(channels, n) of the bank's sound, (W, b, n) and (b, 3, n): microphones hear through the air, the others sum
    their weight set over the bodies.
    """
    here, there, newest = state.window[0], state.window[1], state.window[-1]
    end = newest.position_m.copy()  # of bodies that came later than this step: where they came
    end[: len(there.position_m)] = there.position_m
    begin = end.copy()
    begin[: len(here.position_m)] = here.position_m
    teleported = np.zeros(len(end), bool)
    teleported[: len(there.teleported)] = there.teleported
    observed = path.propagate(state.path, state.travelling, state.number, modal[0], pushed, begin, end, teleported, x)
    frame = np.zeros((len(setup.sensors), modal.shape[2]))
    microphones, readers = iter(observed), iter(modal[1:])
    for channel, sensor in enumerate(setup.sensors):
        frame[channel] = next(microphones) if isinstance(sensor, Microphone) else _summed(next(readers))
    if not np.isfinite(frame).all():
        raise AudioError("the synthesizer made NaN or infinite samples", "report the contact log: this must not happen")
    return frame


def _summed(rows: Array) -> Array:
    """Sum over bodies in their order: the same bits whatever a library thinks is faster."""
    total = np.zeros(rows.shape[1])
    for row in rows:
        total += row
    return total


class Synthesizer:
    """Steps in, lagging frames out: the live form of `take_step`, with the sound so far kept."""

    def __init__(self, *, sr: int, sensors: tuple[Sensor, ...], seed: int, air: Air, residual: bool = True) -> None:
        self._setup = Setup(sr, sensors, seed, air, residual)
        self._state = start(self._setup)
        self._clock = Clock()
        self._frames: list[Array] = []
        self._lag = np.zeros((len(sensors), 0))
        self._steps = 0

    @property
    def time_s(self) -> float:
        """Physics time taken in."""
        return float(self._clock.time_s)

    def feed(self, step: Step, bodies: tuple[Body, ...]) -> Array:
        """Take in a step; the frame (channels, n) as long as the step, LATENCY_STEPS late. bodies: all that are known
        by now.

        Without a sensor nothing is computed but the time.
        """
        after = self._clock.after(step.dt_s)
        count = after.sample(self._setup.sr) - self._clock.sample(self._setup.sr)
        self._clock = after
        self._steps += 1
        channels = len(self._setup.sensors)
        if channels == 0:
            return np.zeros((0, count))
        self._state = with_bodies(self._setup, self._state, bodies[len(self._state.resonators) : len(step.position_m)])
        frame, self._state = take_step(self._setup, self._state, step)
        if frame is None:
            # where a step is no whole number of samples (44.1 kHz at 240 Hz), one more, so that uneven frames never run
            # dry
            uneven = (exact_step(step.dt_s) * self._setup.sr).denominator != 1
            fresh = np.zeros((channels, count + (uneven and self._steps == 1)))
        else:
            fresh = frame
            self._frames.append(frame)
        queue = np.concatenate([self._lag, fresh], axis=1)
        if frame is not None and queue.shape[1] < count:  # the step grew: the lag in samples grows with it
            queue = np.concatenate([np.zeros((channels, count - queue.shape[1])), queue], axis=1)
        out, self._lag = queue[:, :count], queue[:, count:]
        return np.ascontiguousarray(out)

    def sound(self) -> Array:
        """(channels, floor(sr·time)) all sound so far, without lag."""
        if not self._setup.sensors:
            return np.zeros((0, self._clock.sample(self._setup.sr)))
        return np.concatenate(
            [np.zeros((len(self._setup.sensors), 0)), *self._frames, drained(self._setup, self._state)], axis=1
        )

    def quench(self) -> None:
        """Stop all that rings where the steps taken in so far end, exactly there at any rate: in frames that is
        LATENCY_STEPS later.
        """
        if self._setup.sensors:
            self._state = replace(self._state, quenches=self._state.quenches | {self._steps})
