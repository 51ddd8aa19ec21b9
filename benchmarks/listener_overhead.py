"""What listening costs: time round each stepSimulation (poses, contacts, rows) over stepSimulation itself, on piles of
boxes.

    python benchmarks/listener_overhead.py [BOXES ...]

Prints microseconds a step (tenth percentiles: a busy machine only adds) and their ratio. Nobody's sound is computed.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import pybullet as p

from sonic_bullet.listener import direct_client, disconnect, open_world


def measure(boxes: int, warm: int = 240, steps: int = 200) -> tuple[float, float, float, float]:
    """Tenth percentiles (a busy machine only adds) in µs: stepSimulation, before_step, after_step; and contacts per
    step.
    """
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    client.createMultiBody(
        0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[5, 5, 0.5]), basePosition=[0, 0, -0.5]
    )
    box = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.05] * 3)
    rng = np.random.default_rng(0)
    for i in range(boxes):
        shift = rng.uniform(-0.02, 0.02, 2)
        client.createMultiBody(0.1, box, basePosition=[shift[0] + 0.101 * (i % 4), shift[1], 0.06 + 0.101 * (i // 4)])
    world = open_world(client)
    times = []
    for k in range(warm + steps):
        start = time.perf_counter()
        world.before_step()
        ready = time.perf_counter()
        client.stepSimulation()
        stepped = time.perf_counter()
        world.after_step()
        done = time.perf_counter()
        if k >= warm:
            times.append((stepped - ready, ready - start, done - stepped))
    contacts = len(client.getContactPoints())
    disconnect(client)
    step, before, after = np.quantile(times, 0.1, axis=0) * 1e6
    return float(step), float(before), float(after), contacts


if __name__ == "__main__":
    print("boxes  contacts  stepSimulation  before   after   ratio")
    for count in [int(word) for word in sys.argv[1:]] or [1, 20, 100, 300]:
        step_us, before_us, after_us, touching = measure(count)
        print(
            f"{count:5d}  {touching:8d}  {step_us:11.0f} µs  {before_us:6.0f}  {after_us:6.0f}  "
            f"{(before_us + after_us) / step_us:6.2f}",
            flush=True,
        )
