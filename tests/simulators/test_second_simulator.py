"""The door for another simulator: whoever says what `World` asks for is heard, PyBullet or not.

Here a contact log plays the simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.runtime.replay import render_log
from sonic_bullet.records import Body, Material, ModalModel, Shape
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.records.modal_options import ModalOptions
from sonic_bullet.simulators import World
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model


class Recorded(World):
    """A simulator that makes the steps of a log, one after another."""

    def __init__(self, log: sb.ContactLog) -> None:
        self._log, self._next, self.stepped = log, 0, False

    @property
    def bodies(self) -> tuple[Body, ...]:
        return self._log.bodies

    def links_called(self, body: object, link: object) -> tuple[int, tuple[int, ...]]:
        raise SceneError(f"body {body} cannot be added to a log", "its bodies are those that were recorded")

    def name_of(self, body: int, link: int = -1) -> str:
        return f"body {body}"

    def shapes_of(self, body: int, link: int = -1) -> tuple[Shape, ...]:
        return ()

    def add(
        self,
        body: int,
        link: int = -1,
        *,
        material: Material | None = None,
        model: ModalModel | None = None,
        shapes: Sequence[Shape] = (),
        options: ModalOptions | None = None,
    ) -> Body:
        raise SceneError("a log takes no bodies", "record another")

    def after_step(self) -> Step:
        self.stepped = self._next < len(self._log.steps)
        step = self._log.steps[min(self._next, len(self._log.steps) - 1)]
        self._next += 1
        return step

    def unhook(self) -> None:
        self._next = len(self._log.steps)


@pytest.fixture
def log(client: Any) -> sb.ContactLog:
    floor(client)
    listener = sb.attach(client, seed=4)
    listener.add(box(client, (0, 0, 0.2)), material=STEEL, model=plate_model())
    for _ in range(90):
        client.stepSimulation()
    return listener.contacts


def test_another_simulator_sounds_to_the_bit(log: sb.ContactLog) -> None:
    """The same steps from another world are the same sound, live and whole."""
    sound = render_log(log)
    assert np.abs(sound).max() > 0
    with sb.attach(Recorded(log), seed=log.seed, microphone=log.sensors) as listener:
        for _ in log.steps:
            listener.step()
        assert np.array_equal(listener.sound(), sound)
        assert listener.read().shape[1] == sound.shape[1]
        assert listener.notes == ()
        before = listener.frame
        assert listener.step().shape[1] == 0, "a step that was none"
        assert before.shape[1] > 0


def test_what_it_refuses_is_said(log: sb.ContactLog) -> None:
    listener = sb.attach(Recorded(log))
    with pytest.raises(SceneError, match="cannot be added"):
        listener.add(0, material=STEEL)
    with pytest.raises(SceneError, match="bring their names; leave name out"):
        listener.world.call(0, -1, "cup")


def test_a_world_may_say_nothing_of_itself(log: sb.ContactLog) -> None:
    listener = sb.attach(Recorded(log))
    listener.step()
    assert not listener.contacts.engine and not listener.contacts.changes
    assert set(listener.contacts.versions) == {"sonic_bullet", "numpy"}
    assert listener.world.link_name(0, 3) == "3"


def test_a_world_that_leaves_something_out_cannot_be_made() -> None:
    class Mute(World):
        """Says nothing."""

    with pytest.raises(TypeError, match="after_step"):
        Mute()  # type: ignore[abstract]
