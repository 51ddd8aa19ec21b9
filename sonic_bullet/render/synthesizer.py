"""The run time: physics steps in, frames of sound out, with one explicit state between.

    Step -> loads (synth.strikes) -> blows, rubbing -> bank of modes (synth.bank) + jerk of the bodies -> sound path (synth.path) -> frame

A step's sound is made when the `LOOKAHEAD` steps after it are known. Live listening, `sound` (which drains a copy of the state)
and the replay of a log run the same code on the same numbers in the same order: the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sonic_bullet.contacts import Contacts, Step
from sonic_bullet.errors import AudioError
from sonic_bullet.records import Air, Array, Body, Microphone, Sensor
from sonic_bullet.render.blows import Blow, find_blows
from sonic_bullet.render.clock import Clock, exact_step
from sonic_bullet.render.rubbing import Drive, Rubbing, advance_rubbing
from sonic_bullet.render.sounder import Sounder, build_sounder, weight_sets
from sonic_bullet.synth import bank, path
from sonic_bullet.synth.pulse import add_jerk, pulse_nodes
from sonic_bullet.synth.strikes import LOOKAHEAD, LoadHistory, push, split

LATENCY_STEPS = LOOKAHEAD


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What does not change while listening: rate in Hz, sensors (a channel each), seed and medium."""

    sr: int
    sensors: tuple[Sensor, ...]
    seed: int
    air: Air

    @property
    def microphone_m(self) -> Array:
        """(c, 3) places of the microphones among the sensors."""
        return np.array([s.position_m for s in self.sensors if isinstance(s, Microphone)]).reshape(-1, 3)


@dataclass(frozen=True, slots=True, eq=False)
class Pulse:
    """A blow under way: its absolute start in s. Kept until its last sample has sounded."""

    start_s: float
    blow: Blow


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """All that the next frame hangs on. window: the step to be rendered next and those known after it."""

    clock: Clock
    window: tuple[Step, ...]
    loads: LoadHistory
    sounders: tuple[Sounder, ...]
    bank: bank.Bank
    ringing: bank.BankState
    path: path.PathState
    rubbing: Rubbing
    pulses: tuple[Pulse, ...]


def start(setup: Setup) -> State:
    """Silence at time 0, nobody there."""
    instrument, ringing = bank.empty_bank(setup.sr, 1 + len(weight_sets(setup.sensors)))
    return State(Clock(), (), LoadHistory.empty(), (), instrument, ringing, path.start(setup.microphone_m, setup.sr, setup.air), Rubbing.none(), ())


def with_bodies(setup: Setup, state: State, bodies: Sequence[Body]) -> State:
    """The state with further bodies, silent at first."""
    if not bodies:
        return state
    new = tuple(build_sounder(body, setup.sensors, setup.sr, setup.air) for body in bodies)
    modes = [bank.ModeSet(s.omega_rad_s, s.decay_per_s, s.weight) for s in new]
    instrument, ringing = bank.append(state.bank, state.ringing, modes)
    return replace(state, sounders=state.sounders + new, bank=instrument, ringing=ringing)


def take_step(setup: Setup, state: State, step: Step) -> tuple[Array | None, State]:
    """Take in one step; the frame (channels, n) of the step LOOKAHEAD before it, or None while too few are known.

    The bank's and the path's arrays change in place: `copied` a state first to come back to it.
    """
    state = replace(state, window=(*state.window, step), loads=push(state.loads, step.contacts, step.dt_s))
    if len(state.window) <= LOOKAHEAD:
        return None, state
    frame, state = _render(setup, state)
    return frame, replace(state, window=state.window[1:])


def copied(state: State) -> State:
    """A state of its own: advancing one leaves the other."""
    return replace(state, ringing=state.ringing.copy(), path=state.path.copy())


def drained(setup: Setup, state: State) -> Array:
    """(channels, n) sound of the steps taken in but not yet rendered, as if nothing touched any more afterwards. ``state`` stays."""
    state = copied(state)
    frames = [np.zeros((len(setup.sensors), 0))]
    missing = len(state.window)
    while len(state.window) < LOOKAHEAD and state.window:
        last = state.window[-1]
        _, state = take_step(setup, state, replace(last, contacts=Contacts.none()))
    for _ in range(missing):
        last = state.window[-1]
        frame, state = take_step(setup, state, replace(last, contacts=Contacts.none()))
        if frame is not None:
            frames.append(frame)
    return np.concatenate(frames, axis=1)


def quenched(state: State) -> State:
    """Nothing rings and no pulse is under way; the sound still travelling to the microphones is gone too."""
    return replace(state, ringing=bank.silence(state.ringing), path=path.silence(state.path), pulses=())


def _render(setup: Setup, state: State) -> tuple[Array, State]:
    """The frame of window[0]."""
    window, sounders, clock, sr = state.window, state.sounders, state.clock, setup.sr
    step = window[0]
    after = clock.after(step.dt_s)
    first, count = clock.sample(sr), after.sample(sr) - clock.sample(sr)
    x = clock.progress(step.dt_s, sr, count)
    parts, loads = split(state.loads)
    pulses = state.pulses + tuple(Pulse(float(clock.time_s) + blow.start_s, blow) for blow in find_blows(parts, window, sounders))
    new = pulses[len(state.pulses) :]
    drives, rate_n_s, rubbing = advance_rubbing(state.rubbing, parts, window, sounders, x, sr, setup.seed)
    strikes = [strike for pulse in new for strike in _strikes(pulse, sounders, sr)]
    modal = bank.advance(state.bank, state.ringing, count, strikes, _forces(drives, sounders), x)
    _add_pulses(rate_n_s, pulses, sounders, sr, first)
    frame = _at_sensors(setup, state, modal, rate_n_s, window, x)
    end_s = float(after.time_s)
    pulses = tuple(pulse for pulse in pulses if pulse.start_s + pulse.blow.length_s + 3.0 / sr > end_s)
    return frame, replace(state, clock=after, loads=loads, rubbing=rubbing, pulses=pulses)


def _strikes(pulse: Pulse, sounders: tuple[Sounder, ...], sr: int) -> list[bank.Strike]:
    """The pulse on the modes of both bodies. Never before the frame's first sample: a time is a product of roundings."""
    blow = pulse.blow
    offset_s, spacing_s, weight = pulse_nodes(blow.length_s, sr, flat=blow.flat)
    begin = pulse.start_s * sr + offset_s * sr
    sides = ((blow.low, blow.modes_low), (blow.high, blow.modes_high))
    return [bank.Strike(body, begin, spacing_s * sr, weight, gain) for body, gain in sides if gain.any()]


def _forces(drives: Sequence[Drive], sounders: tuple[Sounder, ...]) -> list[bank.Force]:
    return [bank.Force(drive.body, drive.force_n, drive.gain0, drive.gain1) for drive in drives if sounders[drive.body].mode_count]


def _add_pulses(rate_n_s: Array, pulses: tuple[Pulse, ...], sounders: tuple[Sounder, ...], sr: int, first: int) -> None:
    """dF/dt of the pulses under way onto the bodies (b, 3, n). One sample late, so that a pulse that begins with the frame is whole in it."""
    sides = [(side, pulse, sign) for pulse in pulses for side, sign in ((pulse.blow.low, 1.0), (pulse.blow.high, -1.0)) if sounders[side].jerk_coefficient > 0]
    if not sides:
        return
    add_jerk(
        rate_n_s,
        np.array([side for side, _, _ in sides]),
        np.array([pulse.start_s for _, pulse, _ in sides]) + 1.0 / sr,
        np.array([pulse.blow.length_s for _, pulse, _ in sides]),
        np.array([pulse.blow.flat for _, pulse, _ in sides]),
        np.array([sign * pulse.blow.impulse_n_s for _, pulse, sign in sides]),
        sr,
        first,
    )


def _at_sensors(setup: Setup, state: State, modal: Array, rate_n_s: Array, window: tuple[Step, ...], x: Array) -> Array:
    """(channels, n): microphones hear through the air, the other sensors sum their weight set over the bodies."""
    sounders = state.sounders
    here, there = window[0].position_m, window[1].position_m
    known = len(here)
    position0 = np.zeros((len(sounders), 3))
    position1 = np.zeros((len(sounders), 3))
    position0[:known] = here
    position1[: len(there)] = there
    position0[known:] = position1[known:]
    position1[len(there) :] = position0[len(there) :]
    jumped = np.zeros(len(sounders), bool)
    jumped[: len(there)] = window[1].teleported
    inverse_mass = np.array([1.0 / s.body.mass_kg if s.body.mass_kg > 0 else 0.0 for s in sounders])
    jerk = rate_n_s * inverse_mass[:, None, None]
    coefficient = np.array([s.jerk_coefficient if s.body.mass_kg > 0 else 0.0 for s in sounders])
    radius = np.array([s.radius_m for s in sounders])
    heard = path.advance(state.path, modal[0], jerk, coefficient, radius, position0, position1, jumped, x)
    frame = np.zeros((len(setup.sensors), modal.shape[2]))
    microphones, readers = iter(heard), iter(modal[1:])
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

    def __init__(self, *, sr: int, sensors: tuple[Sensor, ...], seed: int, air: Air) -> None:
        self._setup = Setup(sr, sensors, seed, air)
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
        """Take in a step; the frame (channels, n) as long as the step, LATENCY_STEPS late. bodies: all that are known by now."""
        self._state = with_bodies(self._setup, self._state, bodies[len(self._state.sounders) : len(step.position_m)])
        frame, self._state = take_step(self._setup, self._state, step)
        after = self._clock.after(step.dt_s)
        count = after.sample(self._setup.sr) - self._clock.sample(self._setup.sr)
        self._clock = after
        self._steps += 1
        channels = len(self._setup.sensors)
        if frame is None:
            # where a step is no whole number of samples (44.1 kHz at 240 Hz), one more, so that uneven frames never run dry
            uneven = (exact_step(step.dt_s) * self._setup.sr).denominator != 1
            fresh = np.zeros((channels, count + (uneven and self._steps == 1)))
        else:
            fresh = frame
            self._frames.append(frame)
        queue = np.concatenate([self._lag, fresh], axis=1)
        if frame is not None and queue.shape[1] < count:  # the step grew: the lag in samples grows with it
            queue = np.concatenate([np.zeros((channels, count - queue.shape[1])), queue], axis=1)
        out, self._lag = (np.zeros((channels, count)), queue) if frame is None else (queue[:, :count], queue[:, count:])
        return np.ascontiguousarray(out)

    def sound(self) -> Array:
        """(channels, floor(sr·time)) all sound so far, without lag."""
        return np.concatenate([np.zeros((len(self._setup.sensors), 0)), *self._frames, drained(self._setup, self._state)], axis=1)

    def quench(self) -> None:
        """Stop all that rings."""
        self._state = quenched(self._state)
