"""What sensors on surfaces need from one frame to the next, and the channels made with it.

    Step.motions of steps taken in, LOOKAHEAD of which wait -> gains of those rendered now
    driver, each body apart: modes at the sensors, and V   -> `add_rigid` -> summed over bodies, or in space, or apart
        -> `apply_chains`: what the instrument itself does to a channel; `add_noise`: what it adds

All is made sample by sample from the step's own numbers, so live, in blocks and replayed are the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sonic_bullet import _engine
from sonic_bullet._engine import filter_swing
from sonic_bullet.engine.bank.rigid_motion import (
    RIGID_MOTIONS,
    sensor_gains,
    sensor_reading,
    surface_sensors,
    swing_taps,
)
from sonic_bullet.engine.path.surface.sensor_chain import sensor_noise, sensor_taps
from sonic_bullet.records import Array, Body, ContactMicrophone, Sensor, Vibrometer, channels_of


def start_surface(sensors: tuple[Sensor, ...], sr: int, seed: int, *, apart: bool) -> SurfaceState | None:
    """Return the state in silence; None where no sensor is on a surface."""
    return SurfaceState(sensors, sr, seed, apart) if surface_sensors(sensors) else None


@dataclass(slots=True, eq=False)
class SurfaceState:
    """State of sensors on surfaces.

    waiting: motions of steps taken in and not rendered, each (r,) of LINK_MOTION. jointed: rows (d,) of LINK_MOTION by
    a body's index in the log; swings (d, 2): what the filters of those that joints hold have of the samples before.
    past: of each filtered channel (groups, taps - 1), what came last; a group a body where they are
    `apart`.
    """

    sensors: tuple[Sensor, ...]
    sr: int
    seed: int = 0
    apart: bool = False
    waiting: tuple[Array, ...] = ()
    jointed: dict[int, Array] = field(default_factory=dict)
    swings: dict[int, Array] = field(default_factory=dict)
    past: dict[int, Array] = field(default_factory=dict)

    def copy(self) -> SurfaceState:
        """Return an independent copy."""
        return replace(self, jointed=dict(self.jointed), swings=dict(self.swings), past=dict(self.past))

    def quench(self) -> None:
        """Forget what the chains hold."""
        self.past, self.swings = {}, {}

    def subset(self, keep: Array) -> None:
        """Keep the bodies (k,) of these numbers alone, where each is rendered apart."""
        self.past = {c: past[keep] for c, past in self.past.items()} if self.apart else self.past

    def add_rigid(
        self, table: Array, steps_motions: Sequence[Array], out: Array, number: Array, bodies: Sequence[Body]
    ) -> Array:
        """Return what sensors read of each body, (b·sensors, n), of out (b·(sensors + 6), n).

        number (b,): of the bodies in the log; table: STEP rows of the steps taken in; steps_motions:
        LINK_MOTION rows of each.
        """
        total, width = out.shape[1], len(self.sensors)
        by_body = out.reshape(len(bodies), width + RIGID_MOTIONS, total)
        made, moved = by_body[:, :width].copy(), by_body[:, width:]
        self.waiting = (*self.waiting, *steps_motions)
        gains, at = None, 0
        for row in table[table["after_s"] > 0]:
            # a strike is dated back into the step before the one that found it
            known = [one for one in self.waiting[:2] if len(one)]
            self.waiting = self.waiting[1:]
            for motions in known:
                self._learn(motions)
            if known or gains is None:
                gains = self._gains(number, bodies)
            stop = at + int(row["count"])
            for s, gain in gains:
                for i in range(RIGID_MOTIONS):
                    made[:, s, at:stop] += gain[:, i, None] * moved[:, i, at:stop]
            self._add_swings(made[:, :, at:stop], moved[:, :, at:stop], number, bodies)
            at = stop
        return made.reshape(len(bodies) * width, total)

    def _learn(self, motions: Array) -> None:
        for body in np.unique(motions["body"]).tolist():
            self.jointed[body] = motions[motions["body"] == body]

    def _add_swings(self, made: Array, moved: Array, number: Array, bodies: Sequence[Body]) -> None:
        """Add to made (b, sensors, n) the motions of links that joints hold, from V, moved (b, 6, n)."""
        for b, index in enumerate(number.tolist()):
            rows = self.jointed.get(index)
            held = np.zeros(0, np.int64) if rows is None else np.flatnonzero(rows["rate_rad_s"])
            if rows is None or not len(held):
                continue
            past = self.swings.get(index, np.zeros((len(rows), 2)))
            past = self.swings[index] = past.copy() if len(past) == len(rows) else np.zeros((len(rows), 2))
            mine = [(bodies[b].body_id, bodies[b].epoch) == (one.body_id, one.epoch) for one in bodies]
            motion = np.ascontiguousarray(moved[b])
            there = [self.jointed.get(one) if own else None for own, one in zip(mine, number.tolist(), strict=True)]
            for d in held.tolist():
                gains = [
                    (s, sensor_reading(one, bodies, there, d))
                    for s, one in enumerate(self.sensors)
                    if isinstance(one, Vibrometer)
                ]
                swing = np.zeros(moved.shape[2])
                taps = swing_taps(float(rows["rate_rad_s"][d]), float(rows["decay_per_s"][d]), self.sr)
                filter_swing(taps, np.ascontiguousarray(rows["shape"][d]), motion, past[d], swing)
                for s, gain in gains:
                    made[b, s] += gain * swing

    def _gains(self, number: Array, bodies: Sequence[Body]) -> list[tuple[int, Array]]:
        """Return the gains (b, 6) of each sensor on a surface."""
        rows = [self.jointed.get(one) for one in number.tolist()]
        jointed = [None if one is None else one["shape"][one["rate_rad_s"] == 0] for one in rows]
        return [
            (s, sensor_gains(one, bodies, jointed)) for s, one in enumerate(self.sensors) if isinstance(one, Vibrometer)
        ]

    def apply_chains(self, out: Array) -> Array:
        """Return channels (groups·channels, n) as the sensors' own chains pass them on."""
        width, c = channels_of(self.sensors), 0
        made = out.reshape(len(out) // width, width, out.shape[1])
        for sensor in self.sensors:
            taps = sensor_taps(sensor, self.sr)
            if len(taps):
                before = self.past.get(c, np.zeros((0, len(taps) - 1)))
                missing = np.zeros((len(made) - len(before), len(taps) - 1))
                signal = np.concatenate([np.concatenate([before, missing]), made[:, c]], axis=1)
                count = out.shape[1]
                filtered = np.zeros((len(made), count))
                _engine.filter_rows(taps, signal, filtered)
                made[:, c] = filtered
                self.past[c] = signal[:, signal.shape[1] - len(taps) + 1 :].copy()
            c += channels_of([sensor])
        return made.reshape(out.shape)

    def add_noise(self, out: Array, first: int, bodies: Sequence[Body]) -> None:
        """Add the sensors' own noise to channels (groups·channels, n), whose first sample is ``first``.

        Apart, it is in the sound of the body that the sensor is on.
        """
        width, c = channels_of(self.sensors), 0
        made = out.reshape(len(out) // width, width, out.shape[1])
        for s, sensor in enumerate(self.sensors):
            if isinstance(sensor, ContactMicrophone) and sensor.noise_m_s2_rthz and out.shape[1]:
                noise = sensor_noise(sensor.noise_m_s2_rthz, self.sr, (self.seed, s), first, out.shape[1])
                on = [(one.body_id, one.link) == (sensor.body_id, sensor.link) for one in bodies]
                made[[int(np.argmax(on))] if self.apart and any(on) else [] if self.apart else [0], c] += noise
            c += channels_of([sensor])
