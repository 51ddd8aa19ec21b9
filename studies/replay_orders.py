"""Is a replay what was heard?

Random orders of what users do to a world, each played live and replayed from its log, compared bit by bit.

    python studies/replay_orders.py [ORDERS] [SEED]

An order is a list of operations: add, add again, a silent partner, remove, resetSimulation, saveState, restoreState, a
body moved by hand, a speed that is not a number, a second listener, detach, quench, another time step, steps, a look at
the sound under way, disconnect. After each order (and before each disconnect) every listener's `sound()` is held
against `render_log` of its log in memory and read from a file, its `write` against that sound, and its joined frames
against the sound they lag behind. Errors of this project and of PyBullet itself may come; any other ends the run. Where
hypothesis finds an order that differs, it prints the shortest.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st

import sonic_bullet as sb
from sonic_bullet.records import Array, Material, ModalModel
from sonic_bullet.records.errors import SceneWarning, SonicBulletError
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.quiet import quiet_stdout

STEEL = Material.isotropic("steel", youngs_pa=2e11, poisson=0.29, density_kg_m3=7850, alpha_per_s=4.0, beta_s=2e-9)
WOOD = Material.isotropic("wood", youngs_pa=1.1e10, poisson=0.3, density_kg_m3=700, alpha_per_s=40.0, beta_s=2e-7)
EDGES_M = (0.2, 0.1, 0.01)
SENSORS = (sb.Microphone(np.array([0, -0.4, 0.3])), sb.ModalSum())
LAG = sb.Listener.latency_steps

Operation = tuple[str, int, int]


@cache
def plate(material: Material, bent: bool) -> ModalModel:
    """A box whose corners move as seeded directions say: sounds at once, no finite elements.

    bent: its modes go with their level.
    """
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(EDGES_M) / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    face = np.array([t for q in quads for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))], np.int32)
    freq = np.array([740.0, 1230.0, 2950.0])
    volume = float(np.prod(EDGES_M))
    mass = volume * material.density_kg_m3
    shape = np.random.default_rng(0).normal(size=(8, 3, 3)) / np.sqrt(mass)
    decay = 0.5 * ((material.alpha_per_s or 0.0) + (material.beta_s or 0.0) * (2 * np.pi * freq) ** 2)
    bend, damping_growth = (np.full(3, 0.5), np.full(3, 1.0)) if bent else (None, None)
    return ModalModel(
        freq,
        decay,
        shape,
        corner,
        face,
        np.zeros(len(face)),
        volume,
        mass,
        bend_s2_m2=bend,
        damping_growth_s_m=damping_growth,
    )


@dataclass
class Tally:
    """What was compared: listeners, those that sounded, with events in their logs, and how far their replay would be
    off without those (Pa).
    """

    orders: int = 0
    listeners: int = 0
    sounding: int = 0
    framed: int = 0
    eventful: int = 0
    off_without_events: int = 0
    most_off_pa: float = 0.0
    muted: int = 0
    errors: dict[str, int] = field(default_factory=dict)


@dataclass
class Ear:
    """A listener and the frames it gave; steady: the time step was the same all the while."""

    listener: sb.Listener
    frames: list[Array] = field(default_factory=list)
    steady: bool = True


class Play:
    """One order under way."""

    def __init__(self, tally: Tally, folder: Path) -> None:
        self.tally, self.folder = tally, folder
        self.ears: list[Ear] = []
        self.connect()

    def connect(self) -> None:
        self.client = direct_client()
        self.saved: list[int] = []
        self.dt_s = 1 / 240
        self.begin()
        self.listen(0, 0)

    def begin(self) -> None:
        self.client.setGravity(0, 0, -9.81)
        floor = self.client.createMultiBody(0, self.client.createCollisionShape(p.GEOM_PLANE))
        self.client.changeDynamics(floor, -1, restitution=0.6)
        self.bodies: list[int] = []

    def listen(self, _: int, __: int) -> None:
        if len(self.ears) < 3:
            self.ears.append(Ear(sb.attach(self.client, microphone=SENSORS, seed=2)))

    def box(self, where: int, speed: int) -> int:
        shape = self.client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in EDGES_M])
        body = int(
            self.client.createMultiBody(
                0.4,
                shape,
                basePosition=[0.15 * (where % 3), 0, 0.03 + 0.04 * (where // 3)],
                baseOrientation=[0.1, 0, 0, 0.995],
            )
        )
        self.client.resetBaseVelocity(body, [0.4 * (speed % 3 - 1), 0, -0.3 * speed])
        self.bodies.append(body)
        return body

    def partner(self, where: int, speed: int) -> None:
        self.box(where, speed)

    def add(self, where: int, speed: int) -> None:
        body = self.box(where, speed)
        for ear in self.ears:
            ear.listener.add(body, material=STEEL, model=plate(STEEL, where % 2 == 1))

    def add_again(self, which: int, _: int) -> None:
        for ear in self.ears if self.bodies else ():
            ear.listener.add(self.pick(which), material=WOOD, model=plate(WOOD, False))

    def pick(self, which: int) -> int:
        return self.bodies[which % len(self.bodies)]

    def remove(self, which: int, _: int) -> None:
        if self.bodies:
            self.client.removeBody(self.bodies.pop(which % len(self.bodies)))

    def reset(self, _: int, __: int) -> None:
        self.client.resetSimulation()
        self.begin()

    def save(self, _: int, __: int) -> None:
        self.saved.append(self.client.saveState())

    def restore(self, which: int, _: int) -> None:
        if self.saved:
            self.client.restoreState(self.saved[which % len(self.saved)])

    def move(self, which: int, where: int) -> None:
        if self.bodies:
            self.client.resetBasePositionAndOrientation(self.pick(which), [0.2 * where - 0.3, 0.1, 0.05], [0, 0, 0, 1])

    def no_number(self, which: int, _: int) -> None:
        if self.bodies:
            self.client.resetBaseVelocity(self.pick(which), [np.nan, 0, 0])

    def quench(self, _: int, __: int) -> None:
        for ear in self.ears:
            ear.listener.quench()

    def detach(self, which: int, _: int) -> None:
        if self.ears:
            self.ears[which % len(self.ears)].listener.detach()

    def time_step(self, which: int, _: int) -> None:
        self.client.setTimeStep(1 / (240, 480, 1000)[which % 3])

    def look(self, _: int, __: int) -> None:
        for ear in self.ears:
            ear.listener.sound()

    def steps(self, count: int, more: int) -> None:
        dt_s = p.getPhysicsEngineParameters(physicsClientId=self.client._client)["fixedTimeStep"]
        for ear in self.ears:
            ear.steady &= dt_s == self.dt_s
        for _ in range(1 + count + 4 * more):
            observed = [ear.listener.time_s for ear in self.ears]
            self.client.stepSimulation()
            for ear, before_s in zip(self.ears, observed, strict=True):
                if ear.listener.time_s > before_s:
                    ear.frames.append(ear.listener.frame)

    def disconnect(self, _: int, __: int) -> None:
        self.compare()
        disconnect(self.client)
        self.connect()

    def compare(self) -> None:
        """Hold every listener's replay against what it gave, and start without listeners."""
        ears, self.ears = self.ears, []
        for ear in ears:
            compare(ear, self.tally, self.folder)


OPERATIONS: dict[str, Callable[[Play, int, int], None]] = {
    call.__name__: call
    for call in (
        Play.add,
        Play.add_again,
        Play.partner,
        Play.remove,
        Play.reset,
        Play.save,
        Play.restore,
        Play.move,
        Play.no_number,
        Play.quench,
        Play.detach,
        Play.listen,
        Play.time_step,
        Play.look,
        Play.disconnect,
    )
}


def orders(most: int = 24) -> st.SearchStrategy[list[Operation]]:
    """Lists of operations, each with two small numbers.

    They begin with a fall, and a third are steps of physics, or nothing would sound.
    """
    small = st.integers(0, 5)
    step = st.tuples(st.just("steps"), small, small)
    other = st.tuples(st.sampled_from([*OPERATIONS, "quench"]), small, small)
    return st.lists(st.one_of(step, other, other), min_size=6, max_size=most).map(
        lambda rest: [("add", rest[0][1], 3), ("steps", 5, 1), *rest]
    )


def compare(ear: Ear, tally: Tally, folder: Path) -> None:
    """AssertionError where a replay, a file or the frames are not the sound, to the bit."""
    listener = ear.listener
    sound, log = listener.sound(), listener.contacts
    assert np.isfinite(sound).all()
    same(sb.render_log(log), sound, "the log's replay")
    log.save(folder / "log.npz")
    same(sb.render_log(sb.read_log(str(folder / "log.npz"))), sound, "the replay from a file")
    if sound.shape[1]:
        listener.write(folder / "sound.wav")
        same(
            sb.read_audio(str(folder / "sound.wav"))[0].astype(np.float32), sound.astype(np.float32), "the written file"
        )
    if ear.steady and len(ear.frames) > LAG:
        joined = np.concatenate(ear.frames, axis=1)
        lag = sum(frame.shape[1] for frame in ear.frames[:LAG])
        assert not joined[:, :lag].any()
        same(joined[:, lag:], sound[:, : joined.shape[1] - lag], "the frames")
        tally.framed += 1
    tally.listeners += 1
    tally.sounding += bool(sound.any())
    tally.muted += bool(listener.notes)
    if log.events:
        off = float(np.abs(sb.render_log(replace(log, events=())) - sound).max(initial=0.0))
        tally.eventful += 1
        tally.off_without_events += off > 0
        tally.most_off_pa = max(tally.most_off_pa, off)


def same(one: Array, other: Array, what: str) -> None:
    assert one.shape == other.shape, f"{what} has shape {one.shape}, the sound {other.shape}"
    assert one.tobytes() == other.tobytes(), f"{what} is up to {np.abs(one - other).max():.3g} apart"


def play(order: Sequence[Operation], tally: Tally, folder: Path) -> None:
    """Play one order and compare.

    Raises AssertionError, and what neither this project nor PyBullet raises on purpose.
    """
    tally.orders += 1
    with quiet_stdout(), warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", SceneWarning)
        now = Play(tally, folder)
        try:
            for name, i, j in order:
                try:
                    (now.steps if name == "steps" else OPERATIONS[name].__get__(now))(i, j)
                except (SonicBulletError, p.error) as error:
                    kind = f"{name}: {type(error).__name__}"
                    tally.errors[kind] = tally.errors.get(kind, 0) + 1
            now.compare()
        finally:
            with suppress(p.error):
                disconnect(now.client)


def run(count: int, number: int) -> Tally:
    """Play ``count`` random orders. Raises what `play` raises, for the shortest order that hypothesis finds."""
    tally = Tally()
    with tempfile.TemporaryDirectory() as folder:

        @seed(number)
        @settings(max_examples=count, deadline=None, database=None, suppress_health_check=list(HealthCheck))
        @given(orders())
        def check(order: list[Operation]) -> None:
            play(order, tally, Path(folder))

        check()
    return tally


def main(words: Sequence[str]) -> None:
    """Print the counts."""
    numbers: list[Any] = [int(word) for word in words]
    tally = run(*(numbers + [1000, 0][len(numbers) :]))
    print(
        f"{tally.orders} random orders, {tally.listeners} listeners compared ({tally.framed} with their "
        f"frames), {tally.sounding} of them sounded: replay bit-equal to live"
    )
    print(
        f"{tally.eventful} had events in their logs; without those {tally.off_without_events} replays would "
        f"be off, by up to {tally.most_off_pa:.3g}"
    )
    print(f"{tally.muted} had a body muted; errors of our own and of PyBullet: {tally.errors}")


if __name__ == "__main__":
    main(sys.argv[1:])
