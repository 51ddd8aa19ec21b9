"""Setup and state of the run time: tables that are made, enlarged, copied, extended by bodies, quenched.

Each body has two parts in the bank: its modes with the lines of its residual (see residual_voice.py), and its three
translations (see resonator.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from sonic_bullet._engine import RunTime
from sonic_bullet.engine import bank
from sonic_bullet.engine.bank import Bank, BankState, resonator
from sonic_bullet.engine.bank.mode_set import ModeSet
from sonic_bullet.engine.bank.resonator import Resonator, build_resonator, read_sets, weight_set_count
from sonic_bullet.engine.contact.contact_patches import CONTACT_PATCH, SAVED_S, SUPPORT_STATE
from sonic_bullet.engine.contact.load_splitting import SPAN
from sonic_bullet.engine.contact.surface_seed import surface_seed
from sonic_bullet.engine.path import propagation
from sonic_bullet.engine.path.propagation import Path, PathState
from sonic_bullet.engine.path.space.space_state import SpaceState, is_spatial
from sonic_bullet.engine.path.surface.surface_state import SurfaceState, start_surface
from sonic_bullet.engine.residual.player import Grain
from sonic_bullet.engine.runtime.body_table import BodyTable
from sonic_bullet.engine.runtime.channels.body_images import BodyImages, start_images
from sonic_bullet.engine.runtime.channels.directional_weights import Directions
from sonic_bullet.engine.runtime.clock import Clock
from sonic_bullet.engine.runtime.pole_tables import PoleTables, pole_tables
from sonic_bullet.engine.runtime.residual_voice import ResidualVoice, Rubs, build_residual_voice, with_lines
from sonic_bullet.engine.runtime.tables import PAIR, ROW, WINDOW, StepScratch
from sonic_bullet.records import Air, Array, Body, Microphone, Sensor, channels_of
from sonic_bullet.records.contacts import first_bodies

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Constants of listening.

    sr in Hz; sensors; residual: whether those of materials sound; supports: whether resting contacts act on modes;
    apart: whether frames are (b·channels, n), body by body, not their sum; room: what it is in; mixing (channels,
    channels of the sensors): what of them is summed to what is returned; imaged: of how many microphones the last
    sensors are images.
    """

    sr: int
    sensors: tuple[Sensor, ...]
    seed: int
    air: Air
    _: KW_ONLY
    residual: bool = True
    apart: bool = False
    supports: bool = True
    room: RoomPlan | None = None
    mixing: Array | None = None
    imaged: int = 0

    @property
    def microphone_m(self) -> Array:
        """Positions (c, 3) of the microphones among the sensors."""
        return np.array([s.position_m for s in self.sensors if isinstance(s, Microphone)]).reshape(-1, 3)

    @property
    def channels(self) -> int:
        """Number of channels of what is returned."""
        return channels_of(self.sensors) if self.mixing is None else len(self.mixing)

    @property
    def reads(self) -> Array:
        """Weight set (c,) that each sensor reads, 0 for all microphones; then those of rigid motions."""
        return read_sets(self.sensors)


def pair_key(body: Array) -> Array:
    """Compute keys (k,) of pairs of bodies (k, 2), the lower one first."""
    return np.asarray(body[:, 0] << 32 | body[:, 1])


@dataclass(slots=True, eq=False)
class Window:
    """The last SPAN steps, step k in place k % SPAN.

    step (SPAN,) WINDOW; poses and teleports (SPAN, b, ·); row (SPAN·r,) ROW, r for each step.
    """

    step: Array
    position_m: Array
    quaternion_xyzw: Array
    teleported: Array
    row: Array

    def with_bodies(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Make room for further bodies (k,), which appeared at these poses; tables stay in C order."""
        count, turned = len(position_m), quaternion_xyzw
        self.position_m = np.concatenate([self.position_m, np.repeat(position_m[None], SPAN, axis=0)], axis=1)
        self.quaternion_xyzw = np.concatenate([self.quaternion_xyzw, np.repeat(turned[None], SPAN, axis=0)], axis=1)
        self.teleported = np.concatenate([self.teleported, np.zeros((SPAN, count), bool)], axis=1)

    def subset(self, keep: Array, number: Array) -> None:
        """Keep only the bodies ``keep`` (k,). number (b,): the new one of each."""
        self.position_m, self.quaternion_xyzw = self.position_m[:, keep].copy(), self.quaternion_xyzw[:, keep].copy()
        self.teleported = self.teleported[:, keep].copy()
        for first, stop in self.step["row"].tolist():
            row = self.row[first:stop]
            row["body"] = number[row["body"]]
            row["key"] = pair_key(row["body"])

    def with_room(self, rows: int) -> None:
        """Make room for so many rows a step."""
        old = len(self.row) // SPAN
        if rows > old:
            row = np.zeros((SPAN, max(rows, 2 * old)), ROW)
            row[:, :old] = self.row.reshape(SPAN, old)
            self.row = row.reshape(-1)
            self.step["row"] += (np.arange(SPAN) * (row.shape[1] - old))[:, None]

    def copy(self) -> Window:
        """Return an independent copy."""
        return Window(*(getattr(self, name).copy() for name in self.__slots__))


@dataclass(slots=True, eq=False)
class TouchingPairs:
    """Pairs of bodies that touch.

    pair (slots,) PAIR; active (slots,): those in use by rising key; count (2,): how many are in use and free; free
    (slots,); gain (slots, 2, columns): Uᵀ per newton on either body; patch (slots,) CONTACT_PATCH.
    """

    pair: Array
    active: Array
    count: Array
    free: Array
    gain: Array
    patch: Array

    def subset(self, number: Array) -> None:
        """Renumber the bodies; number (b,): the new one of each."""
        active = self.active[: self.count[0]]
        self.pair["body"][active] = number[self.pair["body"][active]]
        self.pair["key"][active] = pair_key(self.pair["body"][active])

    def with_room(self, slots: int, columns: int) -> None:
        """Make room for so many pairs more, and gains of so many columns."""
        old, width = len(self.pair), self.gain.shape[2]
        if self.count[1] >= slots and width >= columns:
            return
        more = 0 if self.count[1] >= slots else max(slots, old, 16)
        self.pair = np.concatenate([self.pair, np.zeros(more, PAIR)])
        self.active = np.concatenate([self.active, np.zeros(more, np.int64)])
        self.free = np.concatenate([np.arange(old + more - 1, old - 1, -1), self.free]).astype(np.int64)
        self.count[1] += more
        gain = np.zeros((old + more, 2, max(columns, width)))
        gain[:old, :, :width] = self.gain
        self.gain = gain
        self.patch = np.concatenate([self.patch, np.zeros(more, CONTACT_PATCH)])

    def copy(self) -> TouchingPairs:
        """Return an independent copy."""
        return TouchingPairs(*(getattr(self, name).copy() for name in self.__slots__))


@dataclass(slots=True, eq=False)
class State:
    """All that the next frame depends on.

    taken: steps taken in; clock: start of the step to be rendered next; waiting: lengths of those taken in and not
    rendered. body (b,): each body's index in the log, ascending; present: those of the step taken in last (the others
    have left, and ring on where they were); newest: the highest so far. quenches: steps before which all ringing stops.
    voices (b): residuals; grains, rubs: their grains and sections under way. observer: called with every step once it
    rings, then one at a time. support_state (b,) SUPPORT_STATE; credit_s (1,): time left for new poles, (0,)
    where nothing supports. space: of microphones that move, ambisonics and heads; surface: of sensors on surfaces;
    directions: of microphones with directivity; sets (c,): the weight set of each microphone. separations: of bodies
    that left, by name, the steps that they rang on contacts, and those with contact separation. images: of bodies in
    faces (images/).
    """

    window: Window
    pairs: TouchingPairs
    table: BodyTable
    bank: Bank
    ringing: BankState
    path: Path
    travelling: PathState
    taken: int = 0
    clock: Clock = field(default_factory=Clock)
    waiting: tuple[float, ...] = ()
    resonators: tuple[Resonator, ...] = ()
    voices: tuple[ResidualVoice | None, ...] = ()
    grains: tuple[Grain, ...] = ()
    rubs: Rubs = field(default_factory=dict)
    body: Array = field(default_factory=lambda: first_bodies(0))
    present: Array = field(default_factory=lambda: first_bodies(0))
    newest: int = -1
    quenches: frozenset[int] = frozenset()
    scratch: StepScratch = field(default_factory=StepScratch)
    reads: Array = field(default_factory=lambda: np.zeros(0, np.int64))
    has_residual: bool = False
    observer: StepObserver | None = None
    support_state: Array = field(default_factory=lambda: np.zeros(0, SUPPORT_STATE))
    credit_s: Array = field(default_factory=lambda: np.zeros(0))
    separations: dict[str, tuple[int, int]] = field(default_factory=dict)
    space: SpaceState | None = None
    surface: SurfaceState | None = None
    directions: Directions | None = None
    sets: Array = field(default_factory=lambda: np.zeros(0, np.int64))
    images: BodyImages = field(default_factory=BodyImages)
    _engine: RunTime = field(default_factory=RunTime)
    _bound: bool = False
    _poles: tuple[tuple[Resonator, ...], PoleTables] | None = None

    @property
    def mapped(self) -> bool:
        """Whether some body's number in the tables is not its index in the log."""
        return self.newest >= len(self.body)

    def mark_changed(self) -> None:
        """Have the engine take the tables anew before the next step, for some table is a new array."""
        self._bound = False

    def engine(self) -> RunTime:
        """Return the compiled stages, on the tables as they are."""
        if not self._bound:
            self._engine.bind(
                window=(self.window, self.images), table=self.table, pairs=self.pairs, supports=self,
                bank=(self.ringing, self.bank), scratch=self.scratch, path=(self.path, self.travelling),
                poles=self._pole_tables(),
            )  # fmt: skip
            self._bound = True
        return self._engine

    def _pole_tables(self) -> PoleTables:
        """Return what the bodies' poles are made of, made anew where they are other bodies."""
        if self._poles is None or self._poles[0] is not self.resonators:
            self._poles = self.resonators, pole_tables(self.resonators, self.voices, self.bank)
        return self._poles[1]._replace(free_law=self.bank.law)

    @property
    def number(self) -> int:
        """Number of the step to be rendered next."""
        return self.taken - len(self.waiting)

    def copy(self) -> State:
        """Return an independent copy: advancing one leaves the other."""
        return State(
            self.window.copy(), self.pairs.copy(), self.table.copy(),
            replace(self.bank, weight=self.bank.weight.copy()), self.ringing.copy(), self.path,
            self.travelling.copy(), self.taken, self.clock, self.waiting, self.resonators, self.voices, self.grains,
            dict(self.rubs), self.body, self.present, self.newest, self.quenches, StepScratch(),
            self.reads, self.has_residual, self.observer, self.support_state.copy(), self.credit_s.copy(),
            dict(self.separations),
            self.space and self.space.copy(), self.surface and self.surface.copy(),
            self.directions and self.directions.copy(), self.sets, self.images.copy(),
        )  # fmt: skip


class StepObserver(Protocol):
    """Observer of what sounds in a step, and why: strikes and drives lie in the state's tables."""

    def __call__(self, state: State, number: int, step: Array, found: int, drives: int) -> None:
        """Observe step ``number``, which has ``found`` pulses and so many drives."""
        ...


def start(setup: Setup) -> State:
    """Return silence at time 0, without bodies."""
    sets, transmissions = weight_set_count(setup.sensors), bank.MOST_PARTNERS if setup.supports else 0
    aims = resonator.aimed_sets(setup.sensors)
    radiates = (aims >= 0) | (np.arange(sets) == 0)
    instrument, ringing = bank.empty_bank(setup.sr, sets, transmissions=transmissions, aims=aims, radiates=radiates)
    air, travelling = propagation.empty_path(setup.sr, setup.air, setup.microphone_m)
    none = np.zeros(0, np.int64)
    poses = np.zeros((SPAN, 0, 3)), np.zeros((SPAN, 0, 4)), np.zeros((SPAN, 0), bool)
    window = Window(np.zeros(SPAN, WINDOW), *poses, np.zeros(0, ROW))
    pairs = TouchingPairs(
        np.zeros(0, PAIR), none, np.zeros(2, np.int64), none, np.zeros((0, 2, 0)), np.zeros(0, CONTACT_PATCH)
    )
    credit_s = np.full(1 if setup.supports else 0, SAVED_S)
    state = State(
        window, pairs, BodyTable(), instrument, ringing, air, travelling, reads=setup.reads, credit_s=credit_s
    )
    state.space = SpaceState(setup.sensors, setup.sr, setup.air) if is_spatial(setup.sensors) else None
    state.surface = start_surface(setup.sensors, setup.sr, setup.seed, apart=setup.apart)
    state.sets, state.images = resonator.microphone_sets(setup.sensors), start_images(setup)
    if hears := resonator.directional(setup.sensors):
        state.directions = Directions(hears)
    return state


def sounding_parts(
    setup: Setup, bodies: Sequence[Body]
) -> tuple[tuple[Resonator, ...], tuple[ResidualVoice | None, ...], list[ModeSet], list[Array], list[int]]:
    """Return of each body its resonator, its residual's voice, its modes, which of them lines follow, and its seed."""
    new = tuple(build_resonator(body, setup.sensors, setup.sr, setup.air) for body in bodies)
    voices = tuple(build_residual_voice(s, setup.sr, setup.air) if setup.residual else None for s in new)
    modes = [with_lines(one, voice) for one, voice in zip(new, voices, strict=True)]
    follows = [np.zeros(0, np.int64) if voice is None else voice.follows for voice in voices]
    return new, voices, modes, follows, [surface_seed(setup.seed, one.body) for one in new]


def with_bodies(setup: Setup, state: State, bodies: Sequence[Body], position_m: Array, quaternion_xyzw: Array) -> None:
    """Add bodies, silent at first, at the poses (k, 3), (k, 4)."""
    new, voices, modes, follows, seeds = sounding_parts(setup, bodies)
    instrument = bank.append(state.bank, state.ringing, modes)
    air = propagation.append_bodies(state.path, state.travelling, np.array([one.radius_m for one in new]))
    state.table.reserve(list(zip(new, follows, strict=True)))
    for one, own, seed in zip(new, follows, seeds, strict=True):  # up to here a refusal has changed nothing
        state.table.add(one, own, seed)
    (state.bank, state.ringing), (state.path, state.travelling) = instrument, air
    state.window.with_bodies(position_m, quaternion_xyzw)
    state.resonators, state.voices = state.resonators + new, state.voices + voices
    state.has_residual = any(voice is not None for voice in state.voices)
    state.support_state = np.concatenate([state.support_state, np.zeros(len(new), SUPPORT_STATE)])
    state.scratch = StepScratch()
    if state.directions is not None:
        state.directions.with_bodies(new, voices, setup.air)
    state.mark_changed()


def quench(state: State) -> None:
    """Stop all ringing from the next sample on, strikes under way and sound travelling to the microphones included.

    Loads, and friction, stay: a ball that rolls rolls on.
    """
    air, travelling = propagation.empty_path(state.path.sr, state.path.air, state.path.microphone_m, state.ringing.at)
    radius = np.array([one.radius_m for one in state.resonators])
    state.path, state.travelling = propagation.append_bodies(air, travelling, radius)
    state.ringing = bank.silence(state.ringing)
    state.grains, state.rubs = (), {}
    for part in (state.space, state.surface):
        if part is not None:
            part.quench()
    state.mark_changed()
    state.quenches = frozenset(number for number in state.quenches if number > state.number)
