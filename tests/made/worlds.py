"""Small PyBullet worlds whose bodies sound at once: models by hand, no finite elements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pybullet as p

from sonic_bullet.records import Material, ModalModel
from sonic_bullet.session import Listener
from tests.made.models import GLASS, STEEL, WOOD, box_model

EDGES_M = (0.2, 0.1, 0.01)
TONES_HZ = (740.0, 1230.0, 2950.0, 5210.0)
MATERIALS = (STEEL, WOOD, GLASS)


def floor(client: Any, restitution: float = 0.6) -> int:
    body = client.createMultiBody(0, client.createCollisionShape(p.GEOM_PLANE))
    client.changeDynamics(body, -1, restitution=restitution, contactProcessingThreshold=0)
    return int(body)


def box(
    client: Any,
    position: Sequence[float],
    *,
    edges: Sequence[float] = EDGES_M,
    mass: float = 0.4,
    turn: Sequence[float] = (0.3, 0.2, 0.1),
) -> int:
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[e / 2 for e in edges])
    body = client.createMultiBody(mass, shape, basePosition=position, baseOrientation=p.getQuaternionFromEuler(turn))
    client.changeDynamics(body, -1, restitution=0.6, contactProcessingThreshold=0, linearDamping=0, angularDamping=0)
    return int(body)


def ball(client: Any, position: Sequence[float], *, radius: float = 0.02, mass: float = 0.1) -> int:
    body = client.createMultiBody(
        mass, client.createCollisionShape(p.GEOM_SPHERE, radius=radius), basePosition=position
    )
    client.changeDynamics(body, -1, restitution=0.6, contactProcessingThreshold=0, linearDamping=0, angularDamping=0)
    return int(body)


def plate_model(material: Material = STEEL) -> ModalModel:
    return box_model(EDGES_M, TONES_HZ, material)


def sounding_box(client: Any, listener: Listener, position: Sequence[float] = (0, 0, 0.2), **how: Any) -> int:
    body = box(client, position, **how)
    listener.add(body, material=STEEL, model=plate_model())
    return body
