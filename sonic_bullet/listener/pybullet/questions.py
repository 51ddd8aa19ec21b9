"""What is asked of PyBullet once a step, and what it costs: a step of one box takes it 6 µs, these 2 µs and more."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pybullet

from sonic_bullet.listener.polling import RawContact, packed
from sonic_bullet.listener.quiet import collector_waiting
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.simulated import Values, finite


class Settings(NamedTuple):
    """The engine's: length of a step, how many sub-steps it has (1: none), gravity in the world."""

    dt_s: float
    substeps: int
    gravity_m_s2: tuple[float, float, float]


def ask(client_id: int, question: Callable[..., Any]) -> Any:
    """What PyBullet answers. Raises SceneError where nobody does."""
    try:
        return question(physicsClientId=client_id)
    except pybullet.error as error:
        raise SceneError(
            f"PyBullet client {client_id} does not answer: {error}", "detach the listener before disconnecting"
        ) from None


def settings(client_id: int) -> Settings:
    """The engine's settings now. Raises SceneError."""
    found = ask(client_id, pybullet.getPhysicsEngineParameters)
    gravity = found["gravityAccelerationX"], found["gravityAccelerationY"], found["gravityAccelerationZ"]
    return Settings(found["fixedTimeStep"], max(1, found["numSubSteps"]), gravity)


def engine(client_id: int) -> Values:
    """All numbers that the engine says of itself, without gravity, which each step tells. Raises SceneError."""
    found = ask(client_id, pybullet.getPhysicsEngineParameters)
    return finite({name: x for name, x in found.items() if not name.startswith("gravity")})


def contact_points(client_id: int) -> tuple[list[RawContact], Array]:
    """All contacts now, and those of them that carry a force, (k,) of RAW. Raises SceneError."""
    with collector_waiting():
        contacts = ask(client_id, pybullet.getContactPoints)
        return contacts, packed(contacts, len(contacts))
