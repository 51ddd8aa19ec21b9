"""Which side of each body a microphone is on, and the weights of its modes there.

    pose at a step's start, microphone -> r̂ in the body's frame -> radiation.pattern: g(r̂)
        -> weights of the microphone's own set in the bank, which free sound reaches over the next block of 256 samples

Within `TURNED` of where it was seen last a body keeps its weights. What it transmits from others, its residual's noise
and echoes in a room have the mean over directions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.engine import bank
from sonic_bullet.engine.bank.instrument import flush_subnormals
from sonic_bullet.engine.bank.resonator import Resonator
from sonic_bullet.engine.contact.load_splitting import LOOKAHEAD, SPAN
from sonic_bullet.engine.path.space.receiver_places import turn_back
from sonic_bullet.radiation.pattern import toward
from sonic_bullet.radiation.radiated import pattern_of
from sonic_bullet.records import Air, Array, Microphone
from sonic_bullet.signal.elementary import complex_product, complex_size

if TYPE_CHECKING:
    from sonic_bullet.engine.runtime.residual_voice import ResidualVoice
    from sonic_bullet.engine.runtime.synthesis_state import Setup, State
    from sonic_bullet.records.step_tables import StepTables

TURNED = 0.02
"""Radians, 1.1°: a sixth of the pattern's grid. Less costs more steps that are looked at one by one."""


@dataclass(slots=True, eq=False)
class Directions:
    """Sides of bodies that microphones are on.

    microphones (D,): their numbers; seen (D, b, 3): unit vectors from bodies, in their frames; grid: of each body, its
    modes' patterns by column of the bank, over the phase of their weights; None: even all around.
    """

    microphones: tuple[int, ...]
    seen: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))
    grid: tuple[Array | None, ...] = ()

    @property
    def patterned(self) -> Array:
        """Return (b,) whether a body does not sound alike all around."""
        return np.array([one is not None for one in self.grid], bool)

    def sides(self, place_m: Array, position_m: Array, quaternion_xyzw: Array) -> Array:
        """Compute unit vectors (…, D, b, 3) from bodies at poses (…, b, ·), in their frames, to microphones (c, 3)."""
        away = turn_back(quaternion_xyzw, place_m[list(self.microphones)][:, None] - position_m)
        return np.asarray(away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-12))

    def find_turned(self, sides: Array) -> Array:
        """Find (D, b) which bodies have turned since they were seen."""
        return np.asarray((((sides - self.seen) ** 2).sum(axis=-1) > TURNED**2) & self.patterned)

    def with_bodies(self, new: Sequence[Resonator], voices: Sequence[ResidualVoice | None], air: Air) -> None:
        """Add bodies, which no microphone has seen."""
        here, count = self.seen.shape[1], len(self.microphones)
        seen = np.zeros((count, here + len(new), 3))
        seen[:, :here] = self.seen.reshape(count, here, 3)
        self.seen = seen
        self.grid += tuple(_grid(one, voice, air) for one, voice in zip(new, voices, strict=True))

    def subset(self, keep: Array) -> None:
        """Keep the bodies (k,) of these numbers alone."""
        self.seen, self.grid = self.seen[:, keep], tuple(self.grid[i] for i in keep)

    def copy(self) -> Directions:
        """Copy the state."""
        return Directions(self.microphones, self.seen.copy(), self.grid)


def _grid(one: Resonator, voice: ResidualVoice | None, air: Air) -> Array | None:
    model = one.body.model
    made = None if model is None or one.keep is None or not one.mode_count else pattern_of(model, air)
    if made is None:
        return None
    weight = one.weight[0]
    size = complex_size(weight)
    own = complex_product(made[:, one.keep], np.where(size > 0, weight.conj() / np.where(size > 0, size, 1), 1))
    lines = own[:, voice.follows] if voice is not None else own[:, :0]
    return np.concatenate([own, lines, np.ones((len(own), one.rigid_columns))], axis=1)


def until_turned(setup: Setup, state: State, steps: StepTables) -> int:
    """Count the steps up to the next one, after the first, in which a body has turned."""
    together = 16  # steps that are looked at ahead, at most: where bodies turn all the time, each is looked at so often
    directions = state.directions
    if directions is None:
        return len(steps)
    moves = any(one.moves for one in setup.sensors if isinstance(one, Microphone))
    if moves or state.mapped or state.present is not state.body or state.taken < LOOKAHEAD:
        return 1
    steps = steps.part(0, together)
    slots = [number % SPAN for number in range(state.taken - LOOKAHEAD, state.taken)]
    place = np.concatenate([state.window.position_m[slots], steps.position_m])[: len(steps), None]
    turn = np.concatenate([state.window.quaternion_xyzw[slots], steps.quaternion_xyzw])
    sides = directions.sides(setup.microphone_m, place, turn[: len(steps), None])
    seen = np.where(directions.find_turned(sides[0])[..., None], sides[0], directions.seen)
    turned = (((sides[1:] - seen) ** 2).sum(axis=-1) > TURNED**2) & directions.patterned
    later = np.flatnonzero(turned.any(axis=(1, 2)))
    return int(later[0]) + 1 if len(later) else len(steps)


def take_aim(setup: Setup, state: State) -> None:
    """Set the weights of the step that is to be rendered next, where a body has turned."""
    directions, ringing, number = state.directions, state.ringing, state.taken - LOOKAHEAD
    if directions is None or number < 0 or not len(state.body):
        return
    slot = number % SPAN
    place = setup.microphone_m if state.space is None or not len(state.space.place_m) else state.space.place_m
    away = directions.sides(place, state.window.position_m[slot], state.window.quaternion_xyzw[slot])
    turned = directions.find_turned(away)
    if not turned.any():
        return
    silent, half, sets = bank.silent(ringing), state.bank.law.shape[1], np.flatnonzero(state.bank.aims >= 0)
    for k, b in np.argwhere(turned).tolist():
        directions.seen[k, b] = away[k, b]
        grid, start = directions.grid[b], int(state.bank.body["start"][b])
        assert grid is not None
        lanes = np.arange(start, start + grid.shape[1])
        weight = state.bank.weight[sets[k], lanes] + 1j * state.bank.weight[sets[k], half + lanes]
        aimed = flush_subnormals(complex_product(weight, toward(grid, away[k, b])))
        for row in (2 * k, 2 * k + 1) if silent[b] else (2 * k + 1,):
            ringing.aim[row, lanes], ringing.aim[row, half + lanes] = aimed.real, aimed.imag
        ringing.turned[k, b] = 0 if silent[b] else 1
