"""What microphones that move, ambisonics and heads need from one frame to the next, and the channels made with it.

    poses of steps taken in, LOOKAHEAD of which wait -> `aim` of those rendered now -> driver, each body apart
        -> `channels`: encoded by direction, filtered by ears, or as they are -> summed over bodies, or a body each

All is made a step at a time from the step's own numbers, so live, in blocks and replayed are the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.engine.path.space.ear_filters import EarFilters, ear_filters
from sonic_bullet.engine.path.space.hearing_directions import hearing_directions
from sonic_bullet.engine.path.space.pose_history import PoseHistory
from sonic_bullet.engine.path.space.receiver_places import aim_at, follows, place_receivers, with_reflections
from sonic_bullet.records import Air, Ambisonics, Array, Binaural, Microphone, Sensor, channels_of

if TYPE_CHECKING:
    from sonic_bullet.engine.bank.resonator import Resonator


def is_spatial(sensors: Sequence[Sensor]) -> bool:
    """Return whether some microphone moves or fills more than one channel."""
    return any(isinstance(one, Microphone) and (one.moves or one.channels > 1) for one in sensors)


def hears_apart(sensors: Sequence[Sensor]) -> bool:
    """Return whether some microphone needs each body's sound apart."""
    return any(isinstance(one, Microphone) and one.channels > 1 for one in sensors)


@dataclass(slots=True, eq=False)
class SpaceState:
    """State of microphones that move, ambisonics and heads.

    waiting_m, waiting_xyzw (w, b, ·): poses of steps taken in and not rendered; history: of those before; past: of
    each head (b, t - 1), what bodies sent last;
    away (k + 1, b, c, 3): to bodies from microphones at the ends of the steps rendered in this call; place_m (c, 3):
    microphones at the last one's end; reflections: of each microphone that is the image of one on a body, the number of
    that, matrix and shift.
    """

    sensors: tuple[Sensor, ...]
    sr: int
    air: Air
    waiting_m: Array = field(default_factory=lambda: np.zeros((0, 0, 3)))
    waiting_xyzw: Array = field(default_factory=lambda: np.zeros((0, 0, 4)))
    history: PoseHistory = field(default_factory=PoseHistory)
    past: dict[int, Array] = field(default_factory=dict)
    away: Array = field(default_factory=lambda: np.zeros((0, 0, 0, 3)))
    place_m: Array = field(default_factory=lambda: np.zeros((0, 3)))
    reflections: dict[int, tuple[int, Array, Array]] = field(default_factory=dict)

    @property
    def microphones(self) -> tuple[Microphone, ...]:
        """Microphones among the sensors."""
        return tuple(one for one in self.sensors if isinstance(one, Microphone))

    def heads(self) -> dict[int, EarFilters]:
        """Look up the filters of heads by their number among the microphones."""
        found = enumerate(self.microphones)
        return {c: ear_filters(one.head, self.sr) for c, one in found if isinstance(one, Binaural)}

    def with_bodies(self, position_m: Array, quaternion_xyzw: Array) -> None:
        """Add bodies (k,), which came where they are."""

        def widened(held: Array, came: Array) -> Array:
            return np.concatenate([held, np.broadcast_to(came, (*held.shape[:-2], *came.shape))], axis=-2)

        self.waiting_m = widened(self.waiting_m, position_m)
        self.waiting_xyzw = widened(self.waiting_xyzw, quaternion_xyzw)
        self.history.with_bodies(position_m)
        for c, filters in self.heads().items():
            held = self.past.get(c, np.zeros((0, filters.size - 1)))
            self.past[c] = np.concatenate([held, np.zeros((len(position_m), filters.size - 1))])

    def subset(self, keep: Array) -> None:
        """Keep the bodies (k,) of these numbers alone."""
        self.waiting_m, self.waiting_xyzw = self.waiting_m[:, keep], self.waiting_xyzw[:, keep]
        self.history.position_m = self.history.position_m[:, keep]
        self.past = {c: past[keep] for c, past in self.past.items()}

    def silent(self) -> Array:
        """Return (b,) whether nothing of a body rings on in a head's responses."""
        quiet = np.ones(self.waiting_m.shape[1], bool)
        for past in self.past.values():
            quiet &= ~past.any(axis=1)
        return quiet

    def quench(self) -> None:
        """Stop what rings on in a head's responses."""
        for past in self.past.values():
            past[:] = 0.0

    def copy(self) -> SpaceState:
        """Copy the state."""
        made: dict[str, Any] = {one.name: getattr(self, one.name) for one in fields(self)}
        made |= {"history": self.history.copy(), "past": {c: past.copy() for c, past in self.past.items()}}
        return SpaceState(**made)

    def aim(self, table: Array, next_s: float, poses: tuple[Array, ...], resonators: Sequence[Resonator]) -> Array:
        """Compute ``aim_m`` of steps to be taken in with poses (s, b, ·), as the driver has it.

        Their directions are kept for `channels`. next_s: when the step after those begins that are rendered.
        """
        position = np.concatenate([self.waiting_m, poses[0]])
        turned = np.concatenate([self.waiting_xyzw, poses[1]])
        microphones = self.microphones
        aim = np.zeros((len(table) + 1, position.shape[1], len(microphones), 3))

        rendered = table[table["after_s"] > 0]
        steps = len(rendered)
        leads = follows(microphones, [(one.body.body_id, one.body.link) for one in resonators])
        if steps:
            time_s = np.concatenate([rendered["begin_s"], rendered["after_s"][-1:], [next_s]])
            places = place_receivers(microphones, leads, time_s, position[: steps + 2], turned[: steps + 2])
            places = with_reflections(places, self.reflections)
            time_s, inner = time_s[:-1], position[: steps + 1]
            aim[len(table) - steps :] = aim_at(microphones, places, time_s, inner, self.air.sound_speed_m_s)
            known_s, known_m = self.history.known_places()
            self.away = hearing_directions(
                time_s, places, np.concatenate([known_s, time_s]), np.concatenate([known_m, inner]),
                self.air.sound_speed_m_s,
            )  # fmt: skip
            self.history.append(time_s[:-1], inner[:-1], self.air.sound_speed_m_s)
            self.place_m = places.position_m[-1]
        self.waiting_m, self.waiting_xyzw = position[steps:], turned[steps:]
        return aim if any(one.moves for one in microphones) else aim[:0, :0, :0]

    def channels(self, table: Array, out: Array, pressure: Array, *, apart: bool) -> Array:
        """Make (channels, n), or apart (b·channels, n), of what the driver made of the steps body by body.

        That is out (b·sensors, n) and pressure (b·microphones, n).
        """
        rendered = table[table["after_s"] > 0]
        sensors, microphones, total = self.sensors, self.microphones, out.shape[1]
        bodies = self.waiting_m.shape[1]
        groups, width = bodies if apart else 1, channels_of(sensors)
        made = np.zeros((groups, width, total))
        if not total or not bodies:
            return made.reshape(groups * width, total)
        first = rendered["sample"] - rendered["sample"][0]
        count, along = np.ascontiguousarray(rendered["count"]), _along(rendered, self.sr)
        by_body, own = pressure.reshape(bodies, len(microphones), total), out.reshape(bodies, len(sensors), total)
        heads, at, c = self.heads(), 0, 0
        for s, sensor in enumerate(sensors):
            if not isinstance(sensor, Microphone) or sensor.channels == 1:
                made[:, at] = own[:, s] if apart else own[:, s].sum(axis=0)
            else:
                rows = np.ascontiguousarray(by_body[:, c])
                filled = np.zeros((groups, sensor.channels, total))
                if isinstance(sensor, Ambisonics):
                    away = np.ascontiguousarray(self.away[:, :, c])
                    _engine.encode_ambisonics(first, count, along, rows, away, sensor.order, filled, apart)
                else:
                    steps = len(rendered) + 1
                    filters = heads[c].at(self.away[:, :, c].reshape(-1, 3)).reshape(steps, bodies, 2, -1)
                    _engine.filter_ears(first, count, along, rows, self.past[c], filters, filled, apart)
                made[:, at : at + sensor.channels] = filled
            at += sensor.channels if isinstance(sensor, Microphone) else 1
            c += isinstance(sensor, Microphone)
        return made.reshape(groups * width, total)


def _along(steps: Array, sr: int) -> Array:
    """Position (n,) of each sample between its step's ends, 0 … 1."""
    parts = [
        np.clip((np.arange(int(one["count"])) + one["offset"]) / ((one["after_s"] - one["begin_s"]) * sr), 0.0, 1.0)
        for one in steps
    ]
    return np.concatenate(parts)
