"""Worlds whose poses are exported and scored: build(client) -> bodies; what they are made of does not matter here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sonic_bullet.session.scene_file import scene_module

SCENES = Path(__file__).resolve().parents[2] / "scenes"


class Scene(NamedTuple):
    """build: sets a client up and returns its bodies."""

    build: Callable[[Any], list[int]]
    seconds: float
    substeps: int = 1


def _file(name: str) -> Callable[[Any], list[int]]:
    def build(client: Any) -> list[int]:
        return list(scene_module(SCENES / f"{name}.py").build(client))

    return build


def _floor(client: Any) -> int:
    client.setGravity(0, 0, -9.81)
    return int(
        client.createMultiBody(
            0, client.createCollisionShape(client.GEOM_BOX, halfExtents=[1, 1, 0.02]), basePosition=[0, 0, -0.02]
        )
    )


def _finished(client: Any, bodies: list[int], restitution: float, friction: float) -> list[int]:
    for body in bodies:
        client.changeDynamics(
            body, -1, restitution=restitution, lateralFriction=friction, rollingFriction=1e-4, spinningFriction=1e-5,
            contactProcessingThreshold=0,
        )  # fmt: skip
    return bodies


def balls(client: Any) -> list[int]:
    """Five balls of three sizes that bounce, roll and meet."""
    made = [_floor(client)]
    for i, (radius, density) in enumerate([(0.02, 7850), (0.015, 2500), (0.03, 700), (0.012, 7850), (0.02, 2500)]):
        ball = client.createMultiBody(
            density * 4.19 * radius**3,
            client.createCollisionShape(client.GEOM_SPHERE, radius=radius),
            basePosition=[0.12 * i - 0.24, 0.03 * (i % 2), 0.15 + 0.07 * i],
        )
        client.resetBaseVelocity(ball, [0.35 * (2 - i) / 2, 0.05 * (1 - i % 3), 0], [1.0, 2.0 * i, 0])
        made.append(ball)
    return _finished(client, made, 0.85, 0.6)


def dice(client: Any) -> list[int]:
    """Five dice thrown together on a table."""
    made, rng = [_floor(client)], np.random.default_rng(5)
    shape = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.012] * 3)
    for i in range(5):
        die = client.createMultiBody(
            0.03, shape, basePosition=[0.04 * i - 0.08, 0.02 * (i % 2), 0.12 + 0.035 * i],
            baseOrientation=client.getQuaternionFromEuler(rng.uniform(-3, 3, 3).tolist()),
        )  # fmt: skip
        client.resetBaseVelocity(die, [0.9, *rng.uniform(-0.2, 0.2, 2).tolist()], rng.uniform(-12, 12, 3).tolist())
        made.append(die)
    return _finished(client, made, 0.7, 0.5)


def bars(client: Any) -> list[int]:
    """Bars, a rod and a brick that fall onto each other."""
    made, rng = [_floor(client)], np.random.default_rng(8)
    for i, edges in enumerate([(0.3, 0.03, 0.006), (0.2, 0.04, 0.01), (0.1, 0.06, 0.03), (0.25, 0.025, 0.008)]):
        bar = client.createMultiBody(
            2700 * float(np.prod(edges)),
            client.createCollisionShape(client.GEOM_BOX, halfExtents=[e / 2 for e in edges]),
            basePosition=[0.02 * i, 0.06 * i - 0.1, 0.1 + 0.09 * i],
            baseOrientation=client.getQuaternionFromEuler(rng.uniform(-0.5, 0.5, 3).tolist()),
        )
        made.append(bar)
    rod = client.createCollisionShape(client.GEOM_CYLINDER, radius=0.008, height=0.18)
    made.append(
        client.createMultiBody(
            0.28, rod, basePosition=[0.1, 0, 0.5], baseOrientation=client.getQuaternionFromEuler([0.3, 1.0, 0.2])
        )
    )
    return _finished(client, made, 0.75, 0.5)


def resting(client: Any) -> list[int]:
    """A pyramid of three bricks, and a ball beside it, that fall a millimetre and stand."""
    made = [_floor(client)]
    brick = client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.05, 0.03, 0.02])
    for x, z in ((-0.06, 0.021), (0.06, 0.021), (0.0, 0.0615)):
        made.append(client.createMultiBody(0.3, brick, basePosition=[x, 0, z]))
    ball = client.createCollisionShape(client.GEOM_SPHERE, radius=0.02)
    made.append(client.createMultiBody(0.2, ball, basePosition=[0, 0.2, 0.021]))
    return _finished(client, made, 0.5, 0.5)


TRUTH = {
    "tabletop": Scene(_file("tabletop"), 2.5),
    "drop": Scene(_file("drop"), 2.0),
    "balls": Scene(balls, 2.5),
    "dice": Scene(dice, 2.0),
    "bars": Scene(bars, 2.0),
    "dice, 4 sub-steps": Scene(dice, 2.0, 4),
}
QUIET = {
    "rolling": Scene(_file("rolling"), 2.0),
    "sliding": Scene(_file("sliding"), 1.5),
    "resting": Scene(resting, 2.0),
}
