"""Who is gone is in no step any more, and, where nobody keeps a log, nothing of it stays."""

from __future__ import annotations

import gc
import tracemalloc
from typing import Any

import numpy as np
import pybullet as p
import pytest

from sonic_bullet.records.contacts import Step, first_bodies
from sonic_bullet.simulators import open_world
from tests.made.models import STEEL
from tests.made.worlds import floor, plate_model

MODEL = plate_model()


class Passing:
    """Balls that come one after another onto a floor, and go; a listener, hooked or raw, sees them."""

    def __init__(self, client: Any, hooked: bool, logged: bool) -> None:
        self.client, self.hooked = client, hooked
        floor(client)
        self.world = open_world(client if hooked else client._client)
        self.world.logged = logged
        self.last: Step | None = None
        self.index: list[int] = []
        if hooked:
            self.world.hook(self.world.before_step, self._after)
        self._shape = client.createCollisionShape(p.GEOM_SPHERE, radius=0.02)

    def _after(self) -> None:
        self.last = self.world.after_step()

    def one(self) -> None:
        """Another one comes, is heard, and goes."""
        ball = self.client.createMultiBody(0.1, self._shape, basePosition=[0, 0, 0.0199])
        self.world.add(ball, material=STEEL, model=MODEL)
        self.index.append(self.world.index_of(ball))
        for _ in range(3):
            if self.hooked:
                self.client.stepSimulation()
            else:
                p.stepSimulation(physicsClientId=self.client._client)
                self._after()
        assert self.last is not None
        assert self.index[-1] in self.last.body
        assert len(self.last.contacts)
        if self.hooked:
            self.client.removeBody(ball)
        else:
            p.removeBody(ball, physicsClientId=self.client._client)


@pytest.mark.parametrize("hooked", [True, False])
def test_a_step_holds_the_living_and_an_index_is_never_given_anew(client: Any, hooked: bool) -> None:
    passing = Passing(client, hooked, logged=True)
    for number in range(20):
        passing.one()
        assert passing.last is not None
        # the floor, met by itself, and the ball that is there
        assert passing.last.body.tolist() == [1, passing.index[-1]] if number else [0, 1]
        assert (passing.last.body is first_bodies(2)) == (number == 0)
        assert len(passing.last.position_m) == 2
    records = passing.world.bodies
    assert passing.index == [0, *range(2, 21)]
    assert [record.until_step for record in records[2:20]] == list(range(6, 60, 3))
    assert [passing.world.records[i] for i in range(21)] == list(records)
    again = passing.world.after_step() if hooked else passing.last
    assert again is not None
    assert again.body is passing.last.body, "who is in a step is one array while it is the same"


@pytest.mark.slow
@pytest.mark.parametrize("hooked", [True, False])
def test_without_a_log_nothing_of_the_gone_stays(client: Any, hooked: bool) -> None:
    passing = Passing(client, hooked, logged=False)
    for _ in range(50):
        passing.one()
    gc.collect()
    tracemalloc.start()
    try:
        for _ in range(300):
            passing.one()
        passing.index.clear()
        gc.collect()
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    print(f"300 bodies more: {grown} bytes")
    assert grown < 150_000, "500 bytes a body: 5 MB are 10,000"
    assert len(passing.world.bodies) <= 2
    assert set(passing.world.records) <= {1, 350}
    assert len(passing.world._added.by_code) <= 1
    assert np.array_equal(passing.last.body, [1, 350])  # type: ignore[union-attr]
