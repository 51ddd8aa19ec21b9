"""The run time: physics steps in, frames of sound out, with one explicit state between (synthesis_state.py).

    Step -> loads (synth.strikes) -> impacts, friction -> bank of modes and of rigid motions (synth.bank) + residual ->
        sound path (synth.path) -> frame

A step's sound is made when the `LOOKAHEAD` steps after it are known. Live listening, `sound` (which drains a copy of
the state) and the replay of a log run the same code on the same numbers in the same order: the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sonic_bullet.records import Air, Array, Body, Microphone, Sensor
from sonic_bullet.records.contacts import Contacts, Step
from sonic_bullet.records.errors import AudioError
from sonic_bullet.render.clock import Clock, exact_step
from sonic_bullet.render.friction_voice import Drive, advance_friction
from sonic_bullet.render.impacts import ForcePulse, find_pulses
from sonic_bullet.render.manifold import orient
from sonic_bullet.render.residual_voice import ResidualVoice, friction_grains, impact_grains
from sonic_bullet.render.resonator import Resonator
from sonic_bullet.render.synthesis_state import PLACES, Setup, State, copied, quenched, start, with_bodies
from sonic_bullet.residual.player import add_grains
from sonic_bullet.synth import bank, path
from sonic_bullet.synth.pulse import pulse_cells, pulse_nodes
from sonic_bullet.synth.strikes import LOOKAHEAD, SPAN, push, split

LATENCY_STEPS = LOOKAHEAD
CELLS_PER_RADIAN = 4.0
"""Cells of a pulse per 1/w of a rigid body: a third of (w·cell)³ = 0.5 % is what its level may err."""


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
    strikes = [
        strike for begin_s, pulse in pulses for strike in _strikes(pulse, begin_s, resonators, voices, sr, first)
    ]
    sound = bank.advance(state.bank, state.ringing, count, strikes, _forces(drives, resonators, voices, x), x)
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
    if any(more is not None for more in voices):
        sound[:, 0::PLACES] += sound[:, 4::PLACES]
    grains = add_grains(sound[:, 0::PLACES], grains, first)
    frame = _at_sensors(setup, state, sound, x)
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
    pulse: ForcePulse,
    step_start_s: float,
    resonators: tuple[Resonator, ...],
    voices: tuple[ResidualVoice | None, ...],
    sr: int,
    earliest: int,
) -> list[bank.Strike]:
    """The pulse on the modes, translations and residual lines of both bodies."""
    offset_s, spacing_s, weight = pulse_nodes(pulse.length_s, sr, flat=pulse.flat)
    start = max((step_start_s + pulse.start_s) * sr, float(earliest))
    strikes = []
    sides = (
        (pulse.low, pulse.share * pulse.modes_low, pulse.share * pulse.impulse_n_s),
        (pulse.high, pulse.share * pulse.modes_high, -pulse.share * pulse.impulse_n_s),
    )
    for body, modes, shove in sides:
        if modes.any():
            strikes.append(bank.Strike(PLACES * body, start + offset_s * sr, spacing_s * sr, weight, modes))
            more = voices[body]
            if more is not None and len(more.follows):
                strikes.append(
                    bank.Strike(PLACES * body + 4, start + offset_s * sr, spacing_s * sr, weight, modes[more.follows])
                )
        rigid = resonators[body].rigid
        if rigid is not None:
            cells = pulse_cells(
                start, pulse.length_s, sr, int(np.ceil(CELLS_PER_RADIAN * rigid.decay_per_s[0] / sr)), flat=pulse.flat
            )
            strikes += [
                bank.Strike(PLACES * body + 1 + int(axis), *cells, shove[axis : axis + 1])
                for axis in np.flatnonzero(shove)
            ]
    return strikes


def _forces(
    drives: Sequence[Drive], resonators: tuple[Resonator, ...], voices: tuple[ResidualVoice | None, ...], x: Array
) -> list[bank.Force]:
    """Drives on modes and residual lines, each with its own gains, and on translations, where all forces on a body act
    as one.
    """
    forces = []
    pushes: dict[int, Array] = {}
    for drive in drives:
        push = drive.force_n * (drive.direction0[:, None] + (drive.direction1 - drive.direction0)[:, None] * x)
        for side, body in enumerate((drive.low, drive.high)):
            if resonators[body].mode_count:
                forces.append(bank.Force(PLACES * body, drive.force_n, drive.gain0[side], drive.gain1[side]))
                more = voices[body]
                if more is not None and len(more.follows):
                    forces.append(
                        bank.Force(
                            PLACES * body + 4,
                            drive.force_n,
                            drive.gain0[side][more.follows],
                            drive.gain1[side][more.follows],
                        )
                    )
            if resonators[body].rigid is not None:
                pushes[body] = pushes.get(body, 0.0) + (push if side == 0 else -push)
    one = np.ones(1)
    return forces + [
        bank.Force(PLACES * body + 1 + axis, push[axis], one, one) for body, push in pushes.items() for axis in range(3)
    ]


def _at_sensors(setup: Setup, state: State, sound: Array, x: Array) -> Array:
    """(channels, n) of the bank's sound (W, PLACES·b, n): microphones hear through the air, the others sum their weight
    set over the bodies.
    """
    modal, pushed = sound[:, 0::PLACES], np.stack([sound[0, part::PLACES] for part in (1, 2, 3)], axis=1)
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
