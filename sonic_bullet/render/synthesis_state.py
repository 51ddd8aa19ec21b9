"""What listening is set up with, and all that the next frame hangs on: made, copied, with further bodies, quenched.

Each body has `PLACES` places in the bank: its modes, its three translations (see resonator.py), and the lines of its
residual (see residual_voice.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet.records import Air, Array, Body, Microphone, Sensor
from sonic_bullet.records.contacts import Step
from sonic_bullet.render.clock import Clock
from sonic_bullet.render.friction_voice import FrictionVoice
from sonic_bullet.render.manifold import Rows
from sonic_bullet.render.residual_voice import ResidualVoice, Rubs, build_residual_voice, line_modes
from sonic_bullet.render.resonator import Resonator, build_resonator, weight_sets
from sonic_bullet.residual.player import Grain
from sonic_bullet.synth import bank, path
from sonic_bullet.synth.bank import Bank, BankState
from sonic_bullet.synth.path import Path, PathState
from sonic_bullet.synth.strikes import SPAN, LoadHistory

PLACES = 5


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """What does not change while listening: rate in Hz, sensors (a channel each), seed and medium; residual: whether
    those of materials are heard.
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
    modes = [
        part
        for s, more in zip(new, voices, strict=True)
        for part in (
            bank.ModeSet(
                s.omega_rad_s,
                s.decay_per_s,
                s.weight,
                bend=s.bend,
                damping_growth=s.damping_growth,
                damping_growth_power=s.damping_growth_power,
            ),
            *((s.rigid or _nothing(setup),) * 3),
            line_modes(more, len(s.weight)),
        )
    ]
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


def _nothing(setup: Setup) -> bank.ModeSet:
    return bank.ModeSet(np.zeros(0), np.zeros(0), np.zeros((1 + len(weight_sets(setup.sensors)), 0), complex))


def copied(state: State) -> State:
    """A state of its own: advancing one leaves the other."""
    return replace(state, ringing=state.ringing.copy(), travelling=state.travelling.copy())


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
