"""Queries to PyBullet that every step makes: 2 µs and more, beside 6 µs for a step of one box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pybullet

from sonic_bullet._engine import read_contacts
from sonic_bullet.listener.polling import RawContact
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.simulated import Values, finite


class Settings(NamedTuple):
    """Settings of the engine: length of a step, its sub-steps (1: none), gravity in the world."""

    dt_s: float
    substeps: int
    gravity_m_s2: tuple[float, float, float]


def ask(client_id: int, question: Callable[..., Any]) -> Any:
    """Return PyBullet's answer; SceneError where the client does not answer."""
    try:
        return question(physicsClientId=client_id)
    except pybullet.error as error:
        raise _unanswered(client_id, error) from None


def _unanswered(client_id: int, error: Exception) -> SceneError:
    return SceneError(
        f"PyBullet client {client_id} does not answer: {error}", "detach the listener before disconnecting"
    )


def settings(client_id: int) -> Settings:
    """Read the engine's settings; raises SceneError."""
    try:
        found = pybullet.getPhysicsEngineParameters(client_id)
    except pybullet.error as error:
        raise _unanswered(client_id, error) from None
    gravity = found["gravityAccelerationX"], found["gravityAccelerationY"], found["gravityAccelerationZ"]
    return Settings(found["fixedTimeStep"], max(1, found["numSubSteps"]), gravity)


def engine(client_id: int) -> Values:
    """Read all numbers that the engine reports, without gravity, which each step holds; raises SceneError."""
    found = ask(client_id, pybullet.getPhysicsEngineParameters)
    return finite({name: x for name, x in found.items() if not name.startswith("gravity")})


def contact_points(client_id: int) -> tuple[list[RawContact], Array]:
    """Read all contacts, and those of them that carry a force, (k,) of RAW; raises SceneError."""
    try:
        return read_contacts(pybullet.getContactPoints, {"physicsClientId": client_id})
    except pybullet.error as error:
        raise _unanswered(client_id, error) from None
