"""When strikes come within a physics step: as gap and approach say, as a neighbour says, else spread by the body."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet._engine import EDGE_MARGIN, phase_in_step
from sonic_bullet.engine.runtime.sound_events import find_sound_events
from sonic_bullet.records import Array
from sonic_bullet.records.contacts import Contacts
from tests.made.jointed import LENGTH_M, make_arm
from tests.made.models import STEEL, ball_body, box_model, row, step, wall_body
from tests.made.stages import Stages

DT = 1 / 240


@pytest.mark.parametrize("seed", [0, 1, 12345, 2**32 - 1])
def test_a_bodys_phases_are_even_however_many_there_are(seed: int) -> None:
    """Three distances, the largest at most 1 + φ = 2.6 times the mean of n [Knuth 3, 6.4, theorem S]."""
    phase = np.array([phase_in_step(seed, count) for count in range(200)])
    assert phase.min() >= EDGE_MARGIN and phase.max() <= 1 - EDGE_MARGIN
    for count in (3, 10, 57, 200):
        cut = np.sort((phase[:count] - EDGE_MARGIN) / (1 - 2 * EDGE_MARGIN))
        assert np.diff(cut).max() < 2.62 / count
        assert np.diff(cut).min() > 0.38 / count


def struck(rows: Callable[[int], Contacts | None], bodies: Any, steps: int = 40) -> Array:
    """Pulses (q,) of steps whose contacts ``rows`` gives, each with its absolute start in steps."""
    stages, found = Stages(bodies), []
    for number in range(steps):
        pulses, _ = stages.take(step([(0, 0, 0)] * len(bodies), rows(number)))
        found += [(stages.rendered + one["ahead"] + one["start_s"] / DT, *one["body"]) for one in pulses]
    return np.array(found).reshape(-1, 3)


def test_what_nothing_dates_is_spread_over_the_step() -> None:
    """A ball in its partner by more than its approach explains, each seventh step; or by a gap that nobody knows."""
    for gap, first in ((-1.0, -1.0), (0.0, 0.0)):
        found = struck(
            lambda number, gap=gap: row(0, 1, (0, 0, 1e-3), gap=gap) if number % 7 == 6 else None,
            (ball_body(0.02), wall_body(body_id=1)), 150,
        )  # fmt: skip
        late = found[:, 0] - np.round((found[:, 0] - first - 6.5) / 7) * 7 - 6
        assert len(found) > 15
        assert (late > first + 0.9 * EDGE_MARGIN).all() and (late < first + 1 - 0.9 * EDGE_MARGIN).all()
        assert np.ptp(late) > 0.8


def test_a_cradle_clicks_in_turn_once_the_first_has_met() -> None:
    """The first pair's gap and approach date it; each of the others follows once half of an impulse was given."""
    balls = tuple(ball_body(0.02, body_id=i) for i in range(5))

    def rows(number: int) -> Contacts | None:
        if number != 6:
            return None
        first = row(0, 1, (0, 0, 0.3), approach=1.0, gap=-2e-3)
        others = [row(i, i + 1, (0, 0, 0.29), approach=0.0, gap=-1e-5) for i in range(1, 4)]
        return Contacts.join([first, *others])

    found = struck(rows, balls)
    assert found[:, 1].tolist() == [0, 1, 2, 3]
    assert found[0, 0] == pytest.approx(6 - 2e-3 / DT, rel=1e-12)
    lag_s = np.diff(found[:, 0]) * DT
    assert (lag_s > 5e-6).all() and (lag_s < 1e-3).all()


def impact_times(client: Any, bodies: dict[tuple[int, int], Any], steps: int) -> list[float]:
    """Start of each impact, in s."""
    listener = sb.attach(client, microphone=(0, -1, 0.5))
    for (body, link), model in bodies.items():
        listener.add(body, link, material=STEEL, model=model)
    for _ in range(steps):
        client.stepSimulation()
    return [one.start_s for one in find_sound_events(listener.contacts) if one.kind == "impact"]


@pytest.mark.parametrize("substeps", [0, 4])
@pytest.mark.parametrize("late", [0.0, 0.3, 0.6])
def test_a_ball_lands_when_it_falls_onto_the_floor(client: Any, substeps: int, late: float) -> None:
    """Closed form of the simulator's own integration: x(n) = h − g·dt²·n(n+1)/2, straight between two steps."""
    dt = DT / max(substeps, 1)
    client.setPhysicsEngineParameter(numSubSteps=substeps)
    client.setGravity(0, 0, -9.81)
    floor = client.createMultiBody(
        0, client.createCollisionShape(p.GEOM_BOX, halfExtents=[1, 1, 0.5]), basePosition=[0, 0, -0.5]
    )
    n = 30 * max(substeps, 1)
    height = 9.81 * dt**2 * ((n - 1) * n / 2 * (1 - late) + n * (n + 1) / 2 * late) + 1e-9
    ball = client.createMultiBody(
        0.05, client.createCollisionShape(p.GEOM_SPHERE, radius=0.02), basePosition=[0, 0, 0.02 + height]
    )
    client.changeDynamics(ball, -1, linearDamping=0, restitution=0.7)
    client.changeDynamics(floor, -1, restitution=1.0)
    sb.keep_restitution(client)
    model = box_model((0.04, 0.04, 0.04), (3000, 5000))
    first = impact_times(client, {(floor, -1): model, (ball, -1): model}, 40)[0]
    assert first == pytest.approx(dt * (n - 1 + late), abs=0.05 * DT)


def test_an_arms_tip_meets_a_block_when_it_gets_there(client: Any) -> None:
    """A straight arm turns at a constant rate about its first hinge onto a block that it meets between two steps."""
    times = []
    for away in (0.0, 0.3e-3, 0.6e-3, 0.9e-3):
        client.resetSimulation()
        client.setGravity(0, 0, 0)
        arm = make_arm(client)
        client.resetJointState(arm, 0, 0.0, 0.5)
        reach = LENGTH_M[0] + LENGTH_M[1] - 0.02
        block = client.createMultiBody(
            0.5, client.createCollisionShape(p.GEOM_SPHERE, radius=0.01), basePosition=[reach, 0.0301 + away, 0]
        )
        for body, link in ((arm, 0), (arm, 1), (block, -1)):
            client.changeDynamics(
                body, link, restitution=0.5, linearDamping=0, angularDamping=0, jointDamping=0,
                contactProcessingThreshold=0,
            )  # fmt: skip
        models = {(arm, 1): box_model((LENGTH_M[1], 0.02, 0.02), (900, 2500)), (block, -1): ball_body(0.01).model}
        times.append(impact_times(client, models, 30)[0])
    lag_s = np.diff(times)
    assert lag_s == pytest.approx(0.3e-3 / (0.5 * (LENGTH_M[0] + LENGTH_M[1] - 0.02)), rel=0.05)
