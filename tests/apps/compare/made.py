"""A small scene as a file, and the same with something else in it."""

from __future__ import annotations

from pathlib import Path

SCENE = '''"""A bar is struck."""

import dataclasses

import sonic_bullet as sb

SECONDS = 0.12
MICROPHONE = (0.0, -0.4, 0.3)


def build(client):
    client.setGravity(0, 0, 0)
    client.setTimeStep(1 / 240)
    far = client.createMultiBody(0.1, client.createCollisionShape(client.GEOM_SPHERE, radius=0.1), -1, [5, 5, 5])
    bar = client.createMultiBody(
        0.188, client.createCollisionShape(client.GEOM_BOX, halfExtents=[0.12, 0.005, 0.005])
    )
    ball = client.createMultiBody(
        0.004, client.createCollisionShape(client.GEOM_SPHERE, radius=0.005), basePosition=[0, 0, 0.025]
    )
    for body in (bar, ball):
        client.changeDynamics(body, -1, lateralFriction=0.5, linearDamping=0)
    client.changeDynamics(bar, -1, restitution=0.9)
    client.changeDynamics(far, -1, restitution=0.5)
    client.changeDynamics(ball, -1, restitution=0.9)
    client.resetBaseVelocity(ball, [0.1, 0, -1.0])
    sb.keep_restitution(client)
    steel = sb.load_material("steel")
    return {bar: {"material": steel, "name": "bar"}, ball: {"material": "steel", "name": "ball"}}
'''


def scene(folder: Path, name: str, *changes: tuple[str, str]) -> Path:
    """The scene's file, each text in it changed to another; each must be there."""
    text = SCENE
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    place = folder / name
    place.write_text(text, encoding="utf-8")
    return place
