"""How fast contacts move over surfaces: rolling, sliding, rest."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonic_bullet.records.contacts import Step
from sonic_bullet.simulators import World
from tests.made.scenes import floor, listen, thing, turned


def sweeps_of(world: World, steps: list[Step], body: int) -> np.ndarray:
    """(rows, 2): speed over the body, over its partner."""
    index = world.index_of(body)
    return np.concatenate(
        [np.where((s.contacts.a == index)[:, None], s.contacts.sweep_m_s, s.contacts.sweep_m_s[:, ::-1]) for s in steps]
    )


@pytest.mark.parametrize("dt", [1 / 60, 1 / 240, 1 / 1000])
@pytest.mark.parametrize("ground", ["plane", "box"])
def test_rolling_ball_sweeps_both_surfaces_at_its_speed(client: Any, ground: str, dt: float) -> None:
    client.setTimeStep(dt)
    floor(client, ground)
    ball = thing(client, "sphere", [0, 0, 0.05])
    client.resetBaseVelocity(ball, [0.8, 0.6, 0], [-12, 16, 0])
    world, steps = listen(client)
    for _ in range(120):
        client.stepSimulation()
    speed = sweeps_of(world, steps[20:], ball)
    assert len(speed) == 100
    assert speed.std() / speed.mean() < 0.01
    assert speed.mean() == pytest.approx(np.linalg.norm(client.getBaseVelocity(ball)[0]), rel=0.01)
    assert max(np.linalg.norm(s.contacts.slip_m_s) for s in steps[20:]) < 1e-3


def test_ball_that_skids_sweeps_by_its_spin_and_the_floor_by_its_speed(client: Any) -> None:
    """A ball spinning in place over ice: its own surface is swept at ωR, the floor not at all."""
    floor(client)
    ball = thing(client, "sphere", [0, 0, 0.05], friction=0)
    client.resetBaseVelocity(ball, [0, 0, 0], [0, 10, 0])
    world, steps = listen(client)
    for _ in range(60):
        client.stepSimulation()
    over_ball, over_floor = sweeps_of(world, steps[10:], ball).mean(axis=0)
    assert over_ball == pytest.approx(0.5, rel=0.01)
    assert over_floor < 0.005


@pytest.mark.parametrize("floor_first", [True, False])
@pytest.mark.parametrize("ground", ["plane", "box"])
def test_sliding_box_sweeps_the_floor_alone(client: Any, ground: str, floor_first: bool) -> None:
    if floor_first:
        floor(client, ground)
    box = thing(client, "box", [0, 0, 0.03], friction=0.2)
    if not floor_first:
        floor(client, ground)
    client.resetBaseVelocity(box, [2, 0.5, 0])
    world, steps = listen(client)
    for _ in range(150):
        client.stepSimulation()
    own, floors = sweeps_of(world, steps[10:], box).T
    index = world.index_of(box)
    slip = np.concatenate([np.linalg.norm(s.contacts.slip_m_s, axis=1) for s in steps[10:]])
    assert slip.mean() > 1
    assert np.median(own / slip) < 0.02
    assert np.percentile(np.abs(floors / slip - 1), 95) < 0.1
    assert index >= 0


def test_slip_is_the_difference_of_both_sweeps(client: Any) -> None:
    """u_b - u_a = slip holds for every row: no sweep is smaller than the other less the slip."""
    floor(client)
    for i in range(4):
        body = thing(
            client, ["cylinder", "capsule", "box", "mesh"][i], [0.3 * i, 0, 0.15], orientation=turned(0.4, 0.3 * i, 0.1)
        )
        client.resetBaseVelocity(body, [0.5, 0.3, 0], [3, 4, 5])
    _, steps = listen(client)
    for _ in range(240):
        client.stepSimulation()
    for rows in (s.contacts for s in steps):
        slip = np.linalg.norm(rows.slip_m_s, axis=1)
        assert (np.abs(rows.sweep_m_s[:, 0] - rows.sweep_m_s[:, 1]) <= slip + 1e-12).all()
        assert (np.abs((rows.slip_m_s * rows.normal).sum(axis=1)) < 1e-12).all()


def test_resting_pile_sweeps_nothing(client: Any) -> None:
    floor(client)
    bodies = [thing(client, "box", [0.01 * (i % 3), 0, 0.03 + 0.061 * i]) for i in range(5)]
    world, steps = listen(client)
    for _ in range(600):
        client.stepSimulation()
    late = np.concatenate([sweeps_of(world, steps[480:], body) for body in bodies])
    assert len(late) > 500
    assert np.percentile(late, 99) < 1e-3
    assert np.abs(late).max() < 0.01
