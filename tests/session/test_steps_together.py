"""Steps that sound together have the samples of steps that sound one by one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.records import Array
from sonic_bullet.session import listening
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL
from tests.made.worlds import ball, box, floor, plate_model

MODEL = plate_model()
HOW: dict[str, Any] = {"sr": 44_100, "microphone": (sb.Microphone([0, 0, 1]), sb.ModalSum()), "seed": 5}
STEPS = 90


@pytest.fixture
def client() -> Iterator[Any]:
    made = direct_client()
    yield made
    disconnect(made)


def run(block: int, keep: bool) -> Array:
    """What is read, block by block: a floor, boxes, and a ball that is soon gone."""
    client = direct_client()
    client.setGravity(0, 0, -9.81)
    floor(client)
    boxes = [box(client, (0.4 * k, 0, 0.05 + 0.02 * k), turn=(0.3, 0.1 * k, 0)) for k in range(3)]
    short = ball(client, (0.4, 0, 0.12))
    read = []
    with sb.attach(client, **HOW, keep_log=keep, keep_sound=keep) as listener:
        for one in boxes:
            listener.add(one, material=STEEL, model=MODEL)
        for first in range(0, STEPS, block):
            with listener.together() if block > 1 else nullcontext():
                for number in range(first, first + block):
                    client.stepSimulation()
                    if number == 37:
                        client.removeBody(short)
                    if number == 50:
                        listener.quench()
                    if number == 70:
                        client.setTimeStep(1 / 200)
            read.append(listener.read())
    disconnect(client)
    return np.concatenate(read, axis=1)


@pytest.mark.parametrize("keep", [True, False])
def test_together_or_one_by_one_samples_are_the_same(keep: bool) -> None:
    alone = run(1, keep)
    assert np.abs(alone).max() > 0
    for block in (9, 30):
        assert np.array_equal(run(block, keep), alone)


def test_a_block_is_one_frame_and_a_block_within_it_ends_with_it(client: Any) -> None:
    floor(client)
    with sb.attach(client, **HOW) as listener:
        with listener.together():
            with listener.together():
                client.stepSimulation()
            client.stepSimulation()
            assert listener.frame.shape[1] == 183  # of the first step, in which what is there becomes known
        client.stepSimulation()
        assert listener.read().shape[1] == 44_100 * 3 // 240


def test_an_error_in_a_block_loses_no_step(client: Any) -> None:
    floor(client)
    with sb.attach(client, **HOW) as listener:
        with pytest.raises(ZeroDivisionError), listener.together():
            for _ in range(4):
                client.stepSimulation()
            raise ZeroDivisionError
        assert listener.read().shape[1] == 44_100 * 4 // 240


@pytest.mark.parametrize("most", [1, 3, 128])
def test_how_many_steps_wait_changes_neither_frames_nor_log(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """`frame` is the latest step's, whether it sounded by itself or with those that waited."""

    def heard(waiting: int) -> tuple[Array, list[Array], bytes]:
        monkeypatch.setattr(listening, "WAITING_STEPS", waiting)
        client = direct_client()
        client.setGravity(0, 0, -9.81)
        floor(client)
        one = box(client, (0, 0, 0.07), turn=(0.3, 0.1, 0))
        frames = []
        with sb.attach(client, **HOW) as listener:
            listener.add(one, material=STEEL, model=MODEL)
            for number in range(60):
                client.stepSimulation()
                if number % 12 == 11:
                    frames.append(listener.frame)
            rows = b"".join(step.contacts.row.tobytes() + step.position_m.tobytes() for step in listener.contacts.steps)
            sound = listener.read()
        disconnect(client)
        return sound, frames, rows

    sound, frames, rows = heard(8)
    assert np.abs(sound).max() > 0
    other, other_frames, other_rows = heard(most)
    assert np.array_equal(sound, other) and rows == other_rows
    assert all(map(np.array_equal, frames, other_frames))
    assert all(frame.shape[1] in (183, 184) for frame in frames)  # 44.1 kHz at 240 Hz


def test_a_step_is_logged_at_its_number_however_many_wait(client: Any) -> None:
    floor(client)
    one = box(client, (0, 0, 0.5))
    with sb.attach(client, **HOW) as listener:
        listener.add(one, material=STEEL, model=MODEL)
        for number in range(20):
            if number in (5, 13):
                client.resetBasePositionAndOrientation(one, [0, 0, 0.5 + number], [0, 0, 0, 1])
            client.stepSimulation()
        assert [(event.kind, event.step) for event in listener.contacts.events] == [("moved", 5), ("moved", 13)]
