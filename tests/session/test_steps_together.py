"""Steps that sound together have the samples of steps that sound one by one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.listener import direct_client, disconnect
from sonic_bullet.records import Array
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
