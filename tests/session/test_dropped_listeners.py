"""A listener that nobody holds any more goes at once, with its models: the collector of cycles is not waited for."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.scene import render_scene
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL, box_model
from tests.made.worlds import EDGES_M, box, floor


@pytest.fixture(autouse=True)
def without_collector() -> Iterator[None]:
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def heard(client: Any, *, hooked: bool) -> tuple[weakref.ref[Any], ...]:
    client.setGravity(0, 0, -9.81)
    listener = sb.attach(client if hooked else client._client, microphone=(0, -1, 0.5))
    floor(client)
    model = box_model(EDGES_M, (900.0, 2100.0), STEEL)
    listener.add(box(client, (0, 0, 0.1)), material=STEEL, model=model)
    for _ in range(60):
        client.stepSimulation()
        if not hooked:
            listener.step()
    assert np.abs(listener.sound()).max() > 0
    assert len(listener.contacts)
    listener.detach()
    return tuple(map(weakref.ref, (listener, listener.world, listener._synthesizer, model)))


@pytest.mark.parametrize("hooked", [True, False])
def test_a_closed_listener_leaves_nothing(hooked: bool) -> None:
    client = direct_client()
    left = heard(client, hooked=hooked)
    disconnect(client)
    assert [one() for one in left] == [None] * 4


def test_a_listener_whose_world_was_reset_and_whose_client_lives_on_leaves_nothing() -> None:
    client = direct_client()
    for _ in range(3):
        left = heard(client, hooked=True)
        client.resetSimulation()
        assert [one() for one in left] == [None] * 4
    disconnect(client)


def test_a_rendered_scene_leaves_what_its_result_holds(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(
        "SECONDS = 0.1\ndef build(client):\n    client.setGravity(0, 0, -9.81)\n"
        "    shape = client.createCollisionShape(client.GEOM_SPHERE, radius=0.02)\n"
        "    return {client.createMultiBody(0.1, shape, basePosition=[0, 0, 0.1]): 'steel'}\n"
    )
    seen: list[weakref.ref[Any]] = []
    result = render_scene(
        tmp_path / "a.py", sr=8000, at_start=lambda one: seen.extend(map(weakref.ref, (one, one.world)))
    )
    assert len(seen) == 2 and [one() for one in seen] == [None, None]
    assert result.samples.shape == (1, 800)
    assert p.getNumBodies.__name__  # the module is whole again
