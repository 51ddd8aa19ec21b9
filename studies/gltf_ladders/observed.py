"""A scene of a ladder, run, and what of its contacts a prediction speaks of.

scene -> render_scene -> sound, log -> the log once more, watched -> pulses, contact forces at audio rate
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sonic_bullet._engine import ball_patch_m
from sonic_bullet.engine.runtime.body_stems import render_per_body
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.records import Array
from sonic_bullet.scene import RenderResult, render_scene

SR = 48_000
SECONDS = 2.0


@dataclass(frozen=True, slots=True)
class Pulse:
    """A strike. length_s: of its force; flat: a half-sine, else Hertz'."""

    start_s: float
    length_s: float
    flat: bool
    impulse_n_s: float


@dataclass(slots=True, eq=False)
class _Watch:
    """Keeps pulses, and force less load of the first pair that rubs, of every sample."""

    pulses: list[Pulse] = field(default_factory=list)
    force_n: list[Array] = field(default_factory=list)
    load_n: list[float] = field(default_factory=list)
    radius_m: float = 0.0
    pair: Any = None

    def __call__(self, state: Any, number: int, step: Any, found: int, drives: int) -> None:
        frames = int(step["count"])
        for pulse in state.scratch.pulse[:found]:
            start = float(step["after_s" if pulse["ahead"] else "begin_s"]) + float(pulse["start_s"])
            size = float(np.linalg.norm(pulse["impulse_n_s"]))
            self.pulses.append(Pulse(start, float(pulse["length_s"]), bool(pulse["flat"]), size))
        rows = state.scratch.force[: drives * frames].reshape(drives, frames)
        self.force_n.append(rows[0].copy() if drives else np.zeros(frames))
        if drives:
            pair = state.pairs.pair[state.scratch.slot[0]]
            self.radius_m, self.pair = float(pair["radius_m"]), pair.copy()
        self.load_n.append(float(state.pairs.pair[state.scratch.slot[0]]["load_n"]) if drives else 0.0)


class Observed:
    """One scene."""

    def __init__(self, path: Path, seconds: float = SECONDS) -> None:
        self.path = path
        self.result: RenderResult = render_scene(path, seconds=seconds, sr=SR, seed=0, microphones=(0, -1, 0.5))
        self.log: ContactLog = self.result.log
        self.pressure_pa: Array = self.result.samples[0]

    @cached_property
    def _watch(self) -> _Watch:
        watch = _Watch()
        for _ in render_per_body(self.log, observer=watch):
            pass
        return watch

    @property
    def pulses(self) -> list[Pulse]:
        """All of them, in order."""
        return self._watch.pulses

    @property
    def strongest(self) -> Pulse:
        """The pulse of most impulse."""
        return max(self.pulses, key=lambda one: one.impulse_n_s)

    @property
    def force_n(self) -> Array:
        """Contact force less load of what rubs, a sample each, from 0.3 s on."""
        return np.concatenate(self._watch.force_n)[int(0.3 * SR) :]

    @property
    def radius_m(self) -> float:
        """Radius of curvature of what rubs."""
        _ = self._watch.force_n
        return self._watch.radius_m

    @property
    def load_n(self) -> float:
        """Median load of what rubs."""
        loads = np.array(self._watch.load_n)
        return float(np.median(loads[loads > 0])) if (loads > 0).any() else 0.0

    def patch_growth(self) -> float:
        """Exponent of a patch's radius over its load, by the law that its oscillator runs: 1/3 of a ball, 0 of a punch.

        Asked of the run time's own table of a pair, at the scene's load and at eight times as much.
        """
        _ = self._watch.force_n
        pair = self._watch.pair
        modulus_pa, radius_m = float(pair["modulus_pa"]), float(pair["radius_m"])
        first, last = (ball_patch_m(load_n, modulus_pa, radius_m) for load_n in (self.load_n, 8.0 * self.load_n))
        return float(np.log(last / first) / np.log(8.0))

    def stick_fraction(self, start_s: float = 0.3) -> float:
        """Fraction of the contacts' steps in which what slides stands: its slip is under a tenth of the median."""
        rows = self.log.rows
        slip = np.linalg.norm(rows.slip_m_s[self.log.time_s >= start_s], axis=1)
        return float((slip < 0.1 * np.median(slip)).mean()) if len(slip) else 0.0

    def level_db(self, start_s: float = 0.3, end_s: float = SECONDS) -> float:
        """Level of a span re 20 µPa."""
        span = self.pressure_pa[int(start_s * SR) : int(end_s * SR)]
        return float(20 * np.log10(max(float(np.sqrt((span**2).mean())), 1e-12) / 20e-6))

    def alone_pa(self, name: str) -> Array:
        """Sound of one body alone."""
        bodies = tuple(replace(body, silent=body.name != name) for body in self.log.bodies)
        return np.asarray(render_log(replace(self.log, bodies=bodies))[0])

    def with_seed_pa(self, seed: int) -> Array:
        """Sound of the same log with surfaces of another seed."""
        return np.asarray(render_log(replace(self.log, seed=seed))[0])

    def contact_rate_hz(self) -> float:
        """How often the force rises through the load a second [Rice 1944: of a narrow band its frequency]."""
        force = self.force_n
        ups = int(((force[:-1] < 0) & (force[1:] >= 0)).sum())
        return ups / (len(force) / SR)

    def flight(self) -> float:
        """Share of samples without force, while there is load."""
        load = self.load_n
        return float((self.force_n <= -0.999 * load).mean()) if load > 0 else 0.0

    def body(self, name: str) -> Any:
        """The log's record of a body."""
        return next(body for body in self.log.bodies if body.name == name)
