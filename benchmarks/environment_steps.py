"""What sound costs in an environment: SoundObservation beside attach alone, resets, and how samples add up.

python benchmarks/environment_steps.py [--steps 300] [--resets 200] [--count 100000]

Prints one line each: CPU time of an env.step of PandaPush-v3 bare, with attach and with SoundObservation, in turns in
one run; a reset; what the process grows by over resets; the sum of counts at 44.1 kHz and 240 Hz.
"""

from __future__ import annotations

import gc
import time
from pathlib import Path
from typing import Any

import click
import gymnasium
import numpy as np
import panda_gym  # noqa: F401

import sonic_bullet as sb
from sonic_bullet.apps.environments import SoundObservation
from sonic_bullet.simulators import direct_client
from sonic_bullet.simulators.quiet import quiet_stdout

MATERIALS = {2: {"material": "wood", "count": 40}, 3: {"material": "wood", "count": 40}}
WARM = 40


def panda() -> Any:
    with quiet_stdout():  # PyBullet prints its arguments, and this is one table
        return gymnasium.make("PandaPush-v3", max_episode_steps=10**6)


def grown_bytes() -> int:
    """Resident memory of this process."""
    fields = Path("/proc/self/statm").read_text().split()
    return int(fields[1]) * 4096


def costs(steps: int) -> None:
    """An env.step bare, with attach and read, and wrapped: in turns, the same actions."""
    bare, attached, wrapped = panda(), panda(), SoundObservation(panda(), materials=MATERIALS)
    for env in (bare, attached, wrapped):
        env.reset(seed=0)
    listener = sb.attach(attached.unwrapped.sim.physics_client)
    listener.add_all(MATERIALS)
    rng = np.random.default_rng(0)
    spent: dict[str, list[float]] = {"bare": [], "attach": [], "SoundObservation": []}
    for _ in range(WARM + steps):
        action = rng.uniform(-1, 1, 3).astype(np.float32)
        for name, env in zip(spent, (bare, attached, wrapped), strict=True):
            begin = time.process_time()
            env.step(action)
            if name == "attach":
                listener.read()
            spent[name].append(time.process_time() - begin)
    median = {name: float(np.median(times[WARM:])) for name, times in spent.items()}
    print(", ".join(f"{name} {value * 1e6:.0f} µs" for name, value in median.items()), "an env.step (median)")
    paired = np.median(np.subtract(spent["SoundObservation"], spent["attach"])[WARM:])
    print(f"SoundObservation adds {paired * 1e6:.0f} µs to attach")
    print(f"SoundObservation over bare: {median['SoundObservation'] / median['bare']:.2f} (<= 2)")
    listener.detach()
    for env in (bare, attached, wrapped):
        env.close()


def resets(count: int) -> None:
    """Episodes of one step; the first ten are not counted."""
    env, times, begin_bytes = SoundObservation(panda(), materials=MATERIALS), [], 0
    for number in range(10 + count):
        if number == 10:
            gc.collect()
            begin_bytes = grown_bytes()
        begin = time.process_time()
        env.reset(seed=number)
        times.append(time.process_time() - begin)
        env.step(env.action_space.sample())
    gc.collect()
    print(f"a reset {np.median(times[10:]) * 1e3:.1f} ms, {count} of them grow by {grown_bytes() - begin_bytes} bytes")
    env.close()


class Falling(gymnasium.Env[Any, Any]):
    """One step of 1/240 s of an empty world at a time."""

    observation_space = gymnasium.spaces.Discrete(1)
    action_space = gymnasium.spaces.Discrete(1)

    def __init__(self) -> None:
        self.client = direct_client()

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        return 0, {}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        self.client.stepSimulation()
        return 0, 0.0, False, False, {}


def samples(count: int) -> None:
    """The sum of counts over many steps."""
    env = SoundObservation(Falling(), 44_100, materials={})
    env.reset()
    total = sum(env.step(0)[4]["audio_count"] for _ in range(count))
    print(f"{total} samples in {count} steps, floor(44100 · {count} / 240) = {44_100 * count // 240}")


@click.command()
@click.option("--steps", default=300)
@click.option("--resets", "reset_count", default=200)
@click.option("--count", default=100_000)
def main(steps: int, reset_count: int, count: int) -> None:
    costs(steps)
    resets(reset_count)
    samples(count)


if __name__ == "__main__":
    main()
