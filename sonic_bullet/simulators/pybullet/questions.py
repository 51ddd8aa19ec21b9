"""Queries to PyBullet that every step makes: 2 µs and more, beside 6 µs for a step of one box."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pybullet

from sonic_bullet._engine import StepReader
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.simulated import Values, finite
from sonic_bullet.simulators.polling import RawContact
from sonic_bullet.simulators.pybullet.poses import StateReader


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
        raise no_answer_error(client_id, error) from None


def no_answer_error(client_id: int, error: Exception) -> SceneError:
    """Return the error of a client that does not answer."""
    return SceneError(
        f"PyBullet client {client_id} does not answer: {error}", "detach the listener before disconnecting"
    )


def step_reader(client_id: int) -> StepReader:
    """Return what asks a client at each step."""
    return StepReader(pybullet.getContactPoints, pybullet.getPhysicsEngineParameters, client_id)


def settings(client_id: int, reader: StepReader, known: Settings | None) -> Settings:
    """Read the engine's settings: `known` where they have not changed. Raises SceneError."""
    try:
        changed = reader.read_settings()
    except pybullet.error as error:
        raise no_answer_error(client_id, error) from None
    if not changed and known is not None:
        return known
    dt_s, substeps, gravity_m_s2 = reader.settings
    return Settings(dt_s, max(1, substeps), gravity_m_s2)


def engine(client_id: int) -> Values:
    """Read all numbers that the engine reports, without gravity, which each step holds; raises SceneError."""
    found = ask(client_id, pybullet.getPhysicsEngineParameters)
    return finite({name: x for name, x in found.items() if not name.startswith("gravity")})


def contact_points(client_id: int, reader: StepReader, *, stepped: bool) -> tuple[RawContact, ...]:
    """Read all contacts; the reader keeps those that carry a force (`StepReader.poll`). Raises SceneError."""
    try:
        return reader.poll(stepped)
    except pybullet.error as error:
        raise no_answer_error(client_id, error) from None


def begin_usual(reader: StepReader, states: StateReader) -> bool:
    """Read what a usual step is taken from, before it is made; False where something is not as before."""
    try:
        return reader.begin_usual(states.questions)
    except pybullet.error:
        return False


def end_usual(client_id: int, reader: StepReader) -> bool:
    """Add a usual step to those that wait; False where it is none, its contacts asked for. Raises SceneError."""
    try:
        return reader.end_usual() >= 0
    except pybullet.error as error:
        raise no_answer_error(client_id, error) from None
