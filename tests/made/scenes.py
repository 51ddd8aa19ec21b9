"""Small worlds that the listener's tests share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as p
import pybullet_data

from sonic_bullet.records.contacts import Step
from sonic_bullet.simulators import World, open_world

GRAVITY = np.array([0.0, 0.0, -9.81])
DUCK = pybullet_data.getDataPath() + "/duck.obj"
MASS_KG = 0.3


def turned(roll: float, pitch: float, yaw: float) -> Any:
    return p.getQuaternionFromEuler([roll, pitch, yaw])


def collision(client: Any, shape: str) -> int:
    """A collision shape of every kind a single body can have, about 10 cm long."""
    if shape == "compound":
        return client.createCollisionShapeArray(
            shapeTypes=[p.GEOM_SPHERE, p.GEOM_BOX],
            radii=[0.05, 0],
            halfExtents=[[0] * 3, [0.03, 0.04, 0.05]],
            lengths=[0, 0],
            collisionFramePositions=[[-0.05, 0, 0], [0.05, 0, 0]],
            collisionFrameOrientations=[[0, 0, 0, 1], turned(0.3, 0, 0)],
        )
    how: dict[str, Any] = {
        "sphere": {"shapeType": p.GEOM_SPHERE, "radius": 0.05},
        "box": {"shapeType": p.GEOM_BOX, "halfExtents": [0.1, 0.05, 0.03]},
        "capsule": {"shapeType": p.GEOM_CAPSULE, "radius": 0.03, "height": 0.1},
        "cylinder": {"shapeType": p.GEOM_CYLINDER, "radius": 0.03, "height": 0.1},
        "mesh": {"shapeType": p.GEOM_MESH, "fileName": DUCK, "meshScale": [0.1] * 3},
    }[shape]
    return client.createCollisionShape(**how)


def floor(client: Any, kind: str = "box") -> int:
    if kind == "plane":
        return client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE))
    return client.createMultiBody(
        0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[5, 5, 0.5]), basePosition=[0, 0, -0.5]
    )


def thing(
    client: Any, shape: str, position: Any, *, orientation: Any = (0, 0, 0, 1), friction: float = 0.5, **how: Any
) -> int:
    body = client.createMultiBody(
        MASS_KG, collision(client, shape), basePosition=position, baseOrientation=orientation, **how
    )
    client.changeDynamics(body, -1, linearDamping=0, angularDamping=0, lateralFriction=friction)
    return body


def listen(client: Any, observed: Callable[[Step], None] | None = None) -> tuple[World, list[Step]]:
    """A hooked world and the list its steps go to."""
    world, steps = open_world(client), []

    def after() -> None:
        steps.append(world.after_step())

    world.hook(world.before_step, after)
    return world, steps


def impulse_on(world: World, step: Step, body: int, link: int = -1) -> np.ndarray:
    """Σ impulse (3,) of a step on one body."""
    index, rows = world.index_of(body, link), step.contacts
    return ((rows.a == index).astype(float) - (rows.b == index)) @ rows.impulse_n_s if len(rows) else np.zeros(3)
