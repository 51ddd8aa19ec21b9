"""A listener begins anew: the same bytes as a fresh one, and events and errors of worlds that begin anew."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.records.contacts import Event
from sonic_bullet.records.errors import LogError, SceneError, SceneWarning
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL, WOOD
from tests.made.worlds import ball, box, floor, plate_model
from tests.session.test_session_robust import steps
from tests.simulators.test_second_simulator import Recorded

HOW: dict[str, Any] = {"microphone": (sb.Microphone([0, 0, 1]), sb.ModalSum()), "seed": 5}
MODEL = plate_model()


def made(client: Any) -> list[int]:
    """A floor, three bars and a silent ball that meets one of them."""
    floor(client)
    bars = [box(client, (0.4 * k, 0, 0.04 + 0.01 * k), turn=(0.3, 0.1 * k, 0)) for k in range(3)]
    ball(client, (0.4, 0, 0.15))
    return bars


def put_back(client: Any, bars: list[int]) -> None:
    """As an environment does: poses and speeds set by hand."""
    for k, bar in enumerate(bars):
        client.resetBasePositionAndOrientation(bar, [0.4 * k, 0, 0.05], [0, 0, 0, 1])
        client.resetBaseVelocity(bar, [0.05, 0, 0], [0.4, 0, 0.2])


def heard(listener: sb.Listener, step: Callable[[], object], path: Path, count: int = 60) -> tuple[bytes, ...]:
    """All that a listener gives of so many steps, as bytes."""
    frames = []
    for number in range(count):
        step()
        frames.append(listener.frame.tobytes())
        if number == 40:
            listener.quench()
    listener.contacts.save(path)
    read, sound = listener.read(), listener.sound()
    assert np.abs(sound).max() > 0
    return *frames, read.tobytes(), sound.tobytes(), path.read_bytes(), repr(listener.time_s).encode()


@pytest.fixture(params=["hooked", "raw"])
def episode(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """run(anew): two episodes of one world; the second heard by the same listener, reset, or by a fresh one."""
    worlds = []

    def run(anew: bool, *, removed: bool = False) -> tuple[bytes, ...]:
        client = direct_client()
        worlds.append(client)
        client.setGravity(0, 0, -9.81)
        bars = made(client)
        raw = request.param == "raw"
        who = client._client if raw else client
        listener = sb.attach(who, **HOW)
        for bar in bars:
            listener.add(bar, material=STEEL, model=MODEL, name=f"bar {bar}" if bar == bars[1] else None)

        def step() -> None:
            p.stepSimulation(physicsClientId=client._client) if raw else client.stepSimulation()
            if raw:
                listener.step()

        for number in range(50):
            step()
            if number == 20:
                listener.add(bars[0], material=WOOD, model=MODEL)  # its record ends, another begins
                listener.add(bars[0], material=STEEL, model=MODEL)
        if removed:
            p.removeBody(bars[2], physicsClientId=client._client) if raw else client.removeBody(bars[2])
            bars = bars[:2]
        put_back(client, bars)
        if anew:
            listener.reset()
        else:
            listener.detach()
            listener = sb.attach(who, **HOW)
            for bar in (*bars[1:], bars[0]):
                listener.add(bar, material=STEEL, model=MODEL, name=f"bar {bar}" if bar == bars[1] else None)
        return heard(listener, step, tmp_path / "log.npz")

    yield run
    for client in worlds:
        disconnect(client)


@pytest.mark.parametrize("removed", [False, True])
def test_a_reset_listener_gives_the_bytes_of_a_fresh_one(episode: Any, removed: bool) -> None:
    fresh, again = episode(False, removed=removed), episode(True, removed=removed)
    assert len(fresh) == 64
    assert [one == two for one, two in zip(fresh, again, strict=True)] == [True] * 64


@pytest.mark.slow
def test_after_a_reset_there_is_no_frame_until_a_step(client: Any) -> None:
    bars = made(client)
    listener = sb.attach(client, **HOW)
    listener.add(bars[0], material=STEEL, model=MODEL)
    assert listener.frame.shape == (2, 0)
    steps(client, 20)
    listener.reset()
    with pytest.raises(SceneError, match="make a step first"):
        _ = listener.frame
    assert listener.time_s == 0
    assert listener.read().shape == listener.sound().shape == (2, 0)
    assert (len(listener.contacts.steps), listener.contacts.events, len(listener.contacts.bodies)) == (0, (), 1)
    steps(client, 1)
    assert listener.frame.shape == (2, 200)
    client.resetSimulation()
    with pytest.raises(SceneError, match="make a step first"):
        _ = listener.frame
    assert listener.sound().shape == (2, 200), "what was heard stays"
    steps(client, 1)
    assert listener.frame.shape == (2, 200)
    assert listener.contacts.events == (Event("reset", 1),)


def test_a_raw_client_that_was_emptied_is_asked_who_is_the_same(client: Any) -> None:
    """Nobody saw resetSimulation: who has the id, the name and the shape of one that was added counts as that one."""
    bars = made(client)
    listener = sb.attach(client._client, **HOW)
    for bar in bars:
        listener.add(bar, material=STEEL, model=MODEL)
    p.resetSimulation(physicsClientId=client._client)
    floor(client)
    assert [box(client, (0, 0, 1)), ball(client, (0, 0, 2))] == bars[:2]
    listener.reset()
    assert [body.body_id for body in listener.contacts.bodies] == bars[:1]


def test_a_body_left_out_is_listened_to_again_where_its_numbers_came_back(client: Any) -> None:
    bars = made(client)
    listener = sb.attach(client, **HOW)
    for bar in bars:
        listener.add(bar, material=STEEL, model=MODEL)
    steps(client, 5)
    client.resetBaseVelocity(bars[0], [float("nan"), 0, 0])
    with pytest.warns(SceneWarning, match="mute until"):
        steps(client, 2)
    put_back(client, bars)
    client.resetBaseVelocity(bars[0], [0, 0, 0], [0, 0, 0])
    listener.reset()
    steps(client, 2)
    assert listener.left_out == ()
    log = listener.contacts  # Bullet itself lets it collide no more
    assert [body.until_step for body in log.bodies if body.body_id == bars[0]] == [-1]
    assert 0 in log.steps[-1].body


def test_what_was_set_by_hand_and_when_is_an_event_once_a_run(client: Any, tmp_path: Path) -> None:
    bars = made(client)
    listener = sb.attach(client, **HOW)
    for bar in bars:
        listener.add(bar, material=STEEL, model=MODEL)
    steps(client, 10)
    for number in range(4):  # carried by hand through four steps
        client.resetBasePositionAndOrientation(bars[1], [0.4, 0, 0.2 + 0.01 * number], [0, 0, 0, 1])
        steps(client, 1)
    steps(client, 5)
    listener.quench()
    client.resetBasePositionAndOrientation(bars[1], [0.4, 0, 0.2], [0, 0, 0, 1])
    client.resetBasePositionAndOrientation(bars[0], [0, 0, 0.2], [0, 0, 0, 1])
    steps(client, 60)
    log = listener.contacts
    assert log.events == (
        Event("moved", 10, 1), Event("quench", 19), Event("moved", 19, 0), Event("moved", 19, 1)
    )  # fmt: skip
    log.save(tmp_path / "log.npz")
    read = sb.read_log(tmp_path / "log.npz")
    assert read.events == log.events
    assert sb.render_log(read).tobytes() == listener.sound().tobytes()


@pytest.mark.parametrize(("kind", "body"), [("moved", None), ("moved", -1), ("quench", 0), ("reset", 2)])
def test_an_event_of_the_wrong_body_is_refused(kind: str, body: int | None) -> None:
    with pytest.raises(LogError, match="event"):
        Event(kind, 0, body)


def test_a_reset_or_a_body_while_a_step_is_made_is_one_error(client: Any) -> None:
    """Somebody else's hook runs in mid-step. A body that was there when the step began may be added; one that was
    not, and a reset, are refused, and all goes on.
    """
    bars = made(client)
    listener = sb.attach(client, **HOW)
    said: list[str] = []
    todo: list[Callable[[], object]] = []

    def busy() -> None:
        for act in todo:
            try:
                act()
            except SceneError as error:
                said.append(str(error))

    def after() -> None:
        busy()
        listener.step()

    listener.world.hook(listener.world.before_step, after)
    todo[:] = [listener.reset, lambda: listener.add(box(client, (0, 0, 3)), material=STEEL, model=MODEL)]
    steps(client, 1)
    assert len(said) == 2
    assert "reset was called while a step was made" in said[0]
    assert "came while a step was made" in said[1]
    todo[:] = [lambda: listener.add(bars[0], material=STEEL, model=MODEL)]
    steps(client, 1)
    todo.clear()
    steps(client, 60)
    assert len(said) == 2
    assert np.abs(listener.sound()).max() > 0
    assert sb.render_log(listener.contacts).tobytes() == listener.sound().tobytes()


def test_a_detached_listener_and_a_world_without_the_word_say_so(client: Any) -> None:
    bars = made(client)
    listener = sb.attach(client, **HOW)
    listener.add(bars[0], material=STEEL, model=MODEL)
    steps(client, 30)
    replayed = sb.attach(Recorded(listener.contacts), **HOW)
    for _ in range(30):
        replayed.step()
    with pytest.raises(SceneError, match="cannot begin anew"):
        replayed.reset()
    assert replayed.sound().tobytes() == listener.sound().tobytes(), "nothing has changed"
    listener.detach()
    with pytest.raises(SceneError, match="detached"):
        listener.reset()


def test_another_world_that_has_the_word_begins_anew(client: Any) -> None:
    class Rewound(Recorded):
        def reset(self) -> None:
            self._next = 0

    bars = made(client)
    listener = sb.attach(client, **HOW)
    listener.add(bars[0], material=STEEL, model=MODEL)
    steps(client, 40)
    replayed = sb.attach(Rewound(listener.contacts), **HOW)
    for _ in range(25):
        replayed.step()
    replayed.reset()
    for _ in range(40):
        replayed.step()
    assert replayed.sound().tobytes() == listener.sound().tobytes()
