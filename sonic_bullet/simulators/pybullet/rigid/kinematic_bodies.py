"""Bodies that follow a path whatever touches them.

    v = (x(t + dt) - x)/dt - g dt, ω = (turn to there)/dt, before each step: a semi-implicit step then ends on the path

A kinematic body is one of a mass that nothing moves: set poses would be jumps without speed, and a contact with what
jumps makes no sound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.rigid_scene import BodyPath, RigidBody
from sonic_bullet.simulators.animated import rotation


def as_kinematic(body: RigidBody) -> RigidBody:
    """Make a body so heavy that nothing moves it."""
    immovable_kg = 1e6
    kinematic_size_m = 1.0  # of the sphere whose moments it has
    moments = np.full(3, 0.4 * immovable_kg * kinematic_size_m**2)
    return replace(body, mass_kg=immovable_kg, inertia_kg_m2=moments)


def follow_path(client: Any, body_id: int, path: BodyPath) -> Callable[[], None]:
    """Make what leads a body along its path, called before each step."""
    settings = client.getPhysicsEngineParameters()
    dt, fall = settings["fixedTimeStep"], np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
    steps = 0

    def move() -> None:
        nonlocal steps
        steps += 1
        place, turn = pose_at(path, steps * dt)
        now, turned = (np.array(x) for x in client.getBasePositionAndOrientation(body_id))
        velocity, spin = (place - now) / dt - fall * dt, rotation(turned, turn) / dt
        client.resetBaseVelocity(body_id, velocity.tolist(), spin.tolist())

    return move


def pose_at(path: BodyPath, time_s: float) -> tuple[Array, Array]:
    """Return position (3,) and orientation (4,) at a time, held before the first and after the last key."""
    key = path.time_s
    i = int(np.clip(np.searchsorted(key, time_s, side="right") - 1, 0, max(len(key) - 2, 0)))
    j = min(i + 1, len(key) - 1)
    share = min(max((time_s - key[i]) / (key[j] - key[i]), 0.0), 1.0) if j > i else 0.0
    a, b = path.quaternion_xyzw[i], path.quaternion_xyzw[j]
    mixed = a + share * ((b if a @ b >= 0 else -b) - a)
    place = path.position_m[i] + share * (path.position_m[j] - path.position_m[i])
    return place, mixed / np.linalg.norm(mixed)
