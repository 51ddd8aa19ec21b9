"""Does memory stay where bodies come and go, and does a step stay as fast? Does a listener that begins anew?

    python studies/bodies_that_go.py [--bodies 10000] [--resets 200]

come and go    boxes of wood fall three at a time, are heard for some steps, and are removed: BulletClient and raw
               client, with log and without; beside them the same world that nobody hears
resets         an environment that removes and creates its bodies: `listener.reset()` each time
reset          what it costs, for three bars and a hundred boxes, and the first step after it

Memory is what the process holds (RSS) after the first tenth and at the end, beside that of the bare world in a process
of its own; speed is processor time of the second tenth and of the last.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import sonic_bullet as sb
from sonic_bullet.records import Material, ModalModel
from sonic_bullet.simulators import direct_client

EDGES_M = (0.2, 0.1, 0.02)
STEPS_EACH = 4
"""Physics steps between two that come: each lives for three times as many, and meets the floor in its first."""


def rss_mb() -> float:
    """What the process holds, in MB."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def wood() -> Material:
    """Dies away within half a second."""
    return Material.isotropic(
        "wood", youngs_pa=1e10, poisson=0.3, density_kg_m3=700.0, alpha_per_s=30.0, beta_s=1e-6, roughness_m=1e-5
    )


class Stage:
    """A floor, a shape, and whoever listens. kind: "bare", "hooked" or "raw"."""

    def __init__(self, kind: str, **options: Any) -> None:
        self.client, self.raw = direct_client(), kind == "raw"
        self.client.setGravity(0, 0, -9.81)
        self.client.createMultiBody(0, self.client.createCollisionShape(p.GEOM_PLANE))
        self.shape = self.client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in EDGES_M])
        who = self.client._client if self.raw else self.client
        self.listener = None if kind == "bare" else sb.attach(who, **options)
        self.model: ModalModel | None = None
        self.material = wood()

    def box(self, place: list[float]) -> int:
        """One more box, heard."""
        body = int(self.client.createMultiBody(0.2, self.shape, basePosition=place))
        if self.listener is not None:
            how: dict[str, Any] = {"model": self.model} if self.model else {"count": 30}
            (self.model,) = self.listener.add(body, material=self.material, **how)
        return body

    def remove(self, body: int) -> None:
        """A raw client's listener is not told."""
        p.removeBody(body, physicsClientId=self.client._client) if self.raw else self.client.removeBody(body)

    def begin_anew(self) -> None:
        """Of whoever listens."""
        if self.listener is not None:
            self.listener.reset()

    def step(self) -> None:
        """A physics step, heard and thrown away."""
        if not self.raw:
            self.client.stepSimulation()
        else:
            p.stepSimulation(physicsClientId=self.client._client)
            self.listener.step()  # type: ignore[union-attr]


def come_and_go(kind: str, bodies: int, **options: Any) -> dict[str, float]:
    """MB grown and the ratio of late steps to early ones."""
    stage, held = Stage(kind, **options), 0.0
    boxes: list[int] = []
    spent: list[float] = []
    rng = np.random.default_rng(0)
    for number in range(bodies):
        begin = time.process_time()
        boxes.append(stage.box([*rng.uniform(-1, 1, 2).tolist(), 0.012]))
        if len(boxes) > 3:
            stage.remove(boxes.pop(0))
        for _ in range(STEPS_EACH):
            stage.step()
        spent.append(time.process_time() - begin)
        if stage.listener is not None:
            stage.listener.read()
        if number == bodies // 10:
            held = rss_mb()
    tenth = bodies // 10
    slower = float(np.median(spent[-tenth:]) / np.median(spent[tenth : 2 * tenth]))
    return {"grown_mb": rss_mb() - held, "slower": slower, "ms": 1e3 * float(np.median(spent[-tenth:]))}


def resets(kind: str, count: int, **options: Any) -> dict[str, float]:
    """MB grown by episodes whose bodies are removed and created."""
    stage, held = Stage(kind, **options), 0.0
    boxes: list[int] = []
    for number in range(count):
        for body in boxes:
            stage.remove(body)
        boxes = [stage.box([0.4 * k, 0, 0.03]) for k in range(3)]
        stage.begin_anew()
        for _ in range(60):
            stage.step()
        if stage.listener is not None:
            stage.listener.read()
        if number == count // 10:
            held = rss_mb()
    return {"grown_mb": rss_mb() - held}


def reset_cost(count: int) -> dict[str, float]:
    """Milliseconds of processor time: a reset, the first step after it, a later one."""
    stage = Stage("hooked")
    for k in range(count):
        stage.box([0.4 * (k % 10), 0.4 * (k // 10), 0.02])
    spent = np.zeros((20, 3))
    for row in spent:
        for _ in range(10):
            stage.step()
        for i, what in enumerate((stage.begin_anew, stage.step, stage.step)):
            begin = time.process_time()
            what()
            row[i] = time.process_time() - begin
    reset, first, later = 1e3 * np.median(spent, axis=0)
    return {"reset_ms": float(reset), "first_step_ms": float(first), "later_step_ms": float(later)}


QUESTIONS: dict[str, Any] = {"come_and_go": come_and_go, "resets": resets, "reset_cost": reset_cost}


def in_a_process(question: str, *arguments: object, **options: object) -> dict[str, float]:
    """What a process of its own measures."""
    asked = json.dumps([question, arguments, options])
    done = subprocess.run([sys.executable, __file__, "--ask", asked], capture_output=True, text=True, check=True)
    return dict(json.loads(done.stdout.strip().splitlines()[-1]))


def main() -> None:
    """Print what was measured, a line each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--bodies", type=int, default=10_000)
    parser.add_argument("--resets", type=int, default=200)
    parser.add_argument("--ask")
    asked = parser.parse_args()
    if asked.ask:
        question, arguments, options = json.loads(asked.ask)
        print(json.dumps(QUESTIONS[question](*arguments, **options)))
        return
    nothing = {"keep_log": False, "keep_sound": False}
    for kind, options in (("bare", {}), ("hooked", nothing), ("raw", nothing), ("hooked", {})):
        print(f"{asked.bodies} bodies, {kind} {options}: {in_a_process('come_and_go', kind, asked.bodies, **options)}")
        print(f"{asked.resets} resets, {kind} {options}: {in_a_process('resets', kind, asked.resets, **options)}")
    for count in (3, 100):
        print(f"reset, {count} bodies: {in_a_process('reset_cost', count)}")


if __name__ == "__main__":
    main()
