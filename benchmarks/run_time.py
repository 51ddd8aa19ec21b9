"""What does sound cost? One table: what was measured, beside what must hold. `make bench` prints it.

    python benchmarks/run_time.py [--boxes 1 20 100] [--steps 480] [--only PART ...]

    piles, quiet, slide    contacts to frame, added to stepSimulation; quiet: nobody hears it, contacts alone
    unsupported            piles whose contacts at rest change no poles: only where --only names it
    robot, replay          a robot's environment; a contact log
    bank, peers            the bank alone (`bank_speed.py`), and other banks in the same run (`peers/`)
    first                  first runs (`first_run.py`)

What is not installed is a row that names the Debian package, and the last line counts such rows.

Every ratio is of two times of one run: two worlds of the same bodies step in turn, one with a listener, one without,
and processor time is taken round each step. Piles fall and settle; a box is of plastic and has 64 audible modes
(asserted); one microphone.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import sonic_bullet as sb
from benchmarks.bank_speed import bank_modes_sustained, envelope_error, growth
from benchmarks.first_run import first_run
from benchmarks.peers import PEERS
from benchmarks.peers.tools import MissingTool
from sonic_bullet.engine.bank.resonator import build_resonator
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.files import read_log
from sonic_bullet.records import Air, ModalModel
from sonic_bullet.scene import render_scene
from sonic_bullet.simulators import direct_client, disconnect
from sonic_bullet.simulators.quiet import quiet_stdout

HALF_M = (0.05, 0.04, 0.03)
MODES = 64
DT = 1 / 240
Row = tuple[str, str, str]
NOT_RUN = "not run: "
PARTS = ("piles", "quiet", "slide", "robot", "replay", "bank", "peers", "first")
EXTRA = ("unsupported",)


def box_model(client: Any, body: int, listener: Any, model: ModalModel | None) -> ModalModel:
    """The body made to sound; its model, which the next ones share."""
    (made,) = listener.add(body, material="plastic", **({"model": model} if model else {"count": MODES}))
    listener.solve_all()  # not within a step
    body_record = replace(listener.world.bodies[-1], model=made)
    heard = build_resonator(body_record, listener.sensors, listener.sr, Air()).mode_count
    assert not listener.sensors or heard == MODES, f"{heard} audible modes, not {MODES}"
    return made


def pile(count: int) -> Any:
    """A floor and boxes that are about to fall onto it, without a listener."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(DT)
    client.createMultiBody(0, client.createCollisionShape(client.GEOM_PLANE))
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=HALF_M)
    rng, side = np.random.default_rng(0), max(1, round(count ** (1 / 3)))
    for i in range(count):
        x, y, z = i % side, i // side % side, i // side**2
        place = np.array([0.12 * x, 0.1 * y, 0.1 + 0.09 * z]) + rng.uniform(-0.01, 0.01, 3)
        turn = client.getQuaternionFromEuler(rng.uniform(-0.2, 0.2, 3).tolist())
        client.createMultiBody(0.4, shape, basePosition=place.tolist(), baseOrientation=turn)
    return client


def slide(count: int) -> Any:
    """A floor and boxes that slide over it."""
    client = pile(0)
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=HALF_M)
    for i in range(count):
        body = client.createMultiBody(0.4, shape, basePosition=[0, 0.1 * i, HALF_M[2]])
        client.changeDynamics(body, -1, lateralFriction=0.1)
        client.resetBaseVelocity(body, [3.0, 0, 0])
    client.changeDynamics(0, -1, lateralFriction=0.1)
    return client


def paired(make: Callable[[], Any], steps: int, **options: Any) -> tuple[float, float, float]:
    """Processor seconds a step without and with a listener, and the slowest percentile with over the median."""
    bare, sounding = make(), make()
    listener = sb.attach(sounding, **options)
    model = None
    for body in range(1, sounding.getNumBodies()):
        model = box_model(sounding, body, listener, model)
    without, with_sound = np.zeros(steps), np.zeros(steps)
    for _ in range(8):  # what is grown once is no step's
        bare.stepSimulation()
        sounding.stepSimulation()
    gc.collect()
    for k in range(steps):
        begin = time.process_time_ns()
        bare.stepSimulation()
        between = time.process_time_ns()
        sounding.stepSimulation()
        without[k], with_sound[k] = between - begin, time.process_time_ns() - between
    begin = time.process_time_ns()
    listener.read()  # steps that wait are their steps', too
    with_sound += (time.process_time_ns() - begin) / steps
    listener.detach()
    disconnect(bare)
    disconnect(sounding)
    worst = float(np.quantile(with_sound, 0.99) / np.median(with_sound))
    return float(without.mean()) / 1e9, float(with_sound.mean()) / 1e9, worst


def piles(counts: list[int], steps: int, **choice: Any) -> list[Row]:
    """Contacts to frame, added to stepSimulation: as a listener is by default, unless arguments say otherwise."""
    limit = {1: "<= 50 µs", 20: "<= 0.8", 100: "<= 0.7"} if not choice else {}
    how = "".join(f", `{name}={value}`" for name, value in choice.items())
    rows = []
    for count in counts:
        bare, sounding, worst = paired(partial(pile, count), steps, **choice)
        added = sounding - bare
        said = f"{added / bare:.2f} ({added * 1e6:.0f} µs on {bare * 1e6:.0f}; 1 % of steps over {worst:.1f} medians)"
        rows.append((f"pile of {count}{how}, added to a step", limit.get(count, ""), said))
    return rows


def quiet(counts: list[int], steps: int) -> list[Row]:
    """Contacts alone: nobody hears them."""
    rows = []
    for count in counts:
        bare, sounding, _ = paired(lambda count=count: pile(count), steps, microphone=())  # type: ignore[misc]
        added = f"{(sounding - bare) / bare:.2f} ({(sounding - bare) * 1e6:.0f} µs)"
        rows.append((f"pile of {count}, `microphone=()`, added", "<= 0.6" if count == 100 else "", added))
    return rows


def sliding(count: int, steps: int) -> list[Row]:
    """Pairs that slide: all of a step as a share of what it lasts."""
    bare, sounding, _ = paired(lambda: slide(count), min(steps, 200))
    said = f"{sounding / DT:.2f} (without sound {bare / DT:.2f})"
    return [(f"{count} sliding pairs, whole step over its length", "<= 0.4" if count == 100 else "", said)]


def robot(steps: int = 140) -> list[Row]:
    """A robot's environment with sound, as `SoundObservation` hears it, and mute; the first 40 steps are not counted.

    The three step in turn.
    """
    try:
        import gymnasium as gym
        import panda_gym  # noqa: F401
    except ImportError:
        return [("PandaPush-v3, env.step", "<= 1.5", f"{NOT_RUN}pip install panda-gym")]
    made: list[tuple[Any, Any]] = []
    choices: tuple[dict[str, Any] | None, ...] = (None, {}, {"microphone": ()})
    for options in choices:
        with quiet_stdout():  # PyBullet prints its arguments, and this is one table
            env = gym.make("PandaPush-v3")
        env.reset(seed=0)
        client = env.unwrapped.sim.physics_client  # type: ignore[attr-defined]
        listener: Any = None if options is None else sb.attach(client, **options)
        for body in range(client.getNumBodies() if listener is not None else 0):
            if client.getBodyInfo(body)[1].decode() and client.getNumJoints(body) == 0:
                listener.add(body, material="plastic", count=MODES)
        if listener is not None:
            listener.solve_all()
        made.append((env, listener))
    rng, times = np.random.default_rng(0), np.zeros((steps, len(made)))
    for k in range(steps):
        action = rng.uniform(-1, 1, made[0][0].action_space.shape).astype(np.float32)
        for i, (env, listener) in enumerate(made):
            begin = time.process_time()
            with nullcontext() if listener is None else listener.together():
                env.step(action)
            times[k, i] = time.process_time() - begin
    for env, listener in made:
        if listener is not None:
            listener.detach()
        env.close()
    bare, sounding, mute = np.median(times[min(40, steps // 2) :], axis=0).tolist()
    return [
        ("PandaPush-v3, env.step with one microphone over without listener", "<= 1.5", f"{sounding / bare:.2f}"),
        ("PandaPush-v3, env.step with `microphone=()` over without listener", "<= 1.3", f"{mute / bare:.2f}"),
    ]


def replay(scene: str = "tabletop", seconds: float = 5.0) -> list[Row]:
    """A scene's log, replayed."""
    log = render_scene(Path(__file__).parents[1] / "scenes" / f"{scene}.py", seconds=seconds).log
    with tempfile.TemporaryDirectory() as folder:
        log.save(Path(folder) / "log.npz")
        log = read_log(Path(folder) / "log.npz")
    render_log(log)
    spent = []
    for _ in range(3):
        begin = time.process_time()
        render_log(log)
        spent.append(time.process_time() - begin)
    said = f"{log.duration_s / min(spent):.1f} ({min(spent):.2f} s for {log.duration_s:.1f} s)"
    return [(f"replay of {scene}'s log over real time", ">= 20", said)]


def alone(modes: int = 20_000, many: int = 1_000_000, seconds: int = 10) -> list[Row]:
    """The bank without what strikes it."""
    return [
        ("bank alone, bodies of 200 modes: modes one core sustains", "", f"{bank_modes_sustained(modes) / 1e3:.0f} k"),
        (f"bank, time a mode at {many} over that at {many // 100}", "<= 1.5", f"{growth(many // 100, many):.2f}"),
        (f"bank, error over the envelope, {seconds} s", "<= 1e-6", f"{envelope_error(seconds):.1e}"),
    ]


def peers(scale: float = 1.0, modes: int = 20_000) -> list[Row]:
    """Other banks, this project's measured again beside each."""
    rows = []
    for peer in PEERS:
        try:
            rate = peer.modes_sustained(scale)
        except MissingTool as missing:
            said = f"{NOT_RUN}{missing}"
        else:
            said = f"{rate / 1e3:.1f} k modes (bank {bank_modes_sustained(modes) / rate:.1f} x)"
        rows.append((peer.name, peer.must_hold, said))
    return rows


def first(scene: str = "tabletop", seconds: float = 5.0, *, empty: bool = True) -> list[Row]:
    """First runs. empty: from empty caches, as a first run is."""
    took = first_run(f"scenes/{scene}.py", seconds, empty=empty)
    return [
        ("README's first example, empty caches", "<= 15 s", f"{took.example_s:.1f} s"),
        (f"`render scenes/{scene}.py`, empty caches", "", f"{took.scene_s:.1f} s"),
        ("README's first example to its first frame, models kept", "<= 1 s", f"{took.frame_kept_s:.2f} s"),
        ("`import sonic_bullet`", "<= 0.3 s", f"{took.import_s:.2f} s"),
        (f"`render` of {scene}'s log, {seconds:g} s, models kept", "", f"{took.log_kept_s:.2f} s"),
    ]


def missing_line(rows: list[Row]) -> str:
    """How many rows did not run, and for want of what."""
    lacks = [said.removeprefix(NOT_RUN) for _, _, said in rows if said.startswith(NOT_RUN)]
    return f"{len(lacks)} of {len(rows)} rows not run" + (f": {', '.join(sorted(set(lacks)))}" if lacks else "")


def main() -> int:
    assert __doc__ is not None
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--boxes", type=int, nargs="+", default=[1, 20, 100])
    parser.add_argument("--steps", type=int, default=480)
    parser.add_argument("--only", nargs="+", choices=[*PARTS, *EXTRA], default=list(PARTS), metavar="PART")
    asked = parser.parse_args()
    parts: dict[str, Callable[[], list[Row]]] = {
        "piles": lambda: piles(asked.boxes, asked.steps),
        "quiet": lambda: quiet(asked.boxes, asked.steps),
        "unsupported": lambda: piles(asked.boxes, asked.steps, supports=False),
        "slide": lambda: sliding(100, asked.steps),
        "robot": robot,
        "replay": replay,
        "bank": alone,
        "peers": peers,
        "first": first,
    }
    if {"piles", "quiet", "slide", "robot", "unsupported"} & set(asked.only):
        paired(lambda: pile(2), 120)  # models are made here, and counted nowhere
    print("| what | must hold | measured |\n|---|---|---|")
    rows: list[Row] = []
    for name in asked.only:
        for row in parts[name]():
            rows.append(row)
            print(f"| {' | '.join(row)} |", flush=True)
    print(f"\n{missing_line(rows)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
