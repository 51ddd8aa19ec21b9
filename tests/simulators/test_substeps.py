"""numSubSteps > 1: every sub-step is heard, from Bullet's contact log."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators import open_world
from tests.made.scenes import GRAVITY, MASS_KG, floor, impulse_on, listen, thing, turned


@pytest.mark.parametrize("substeps", [2, 4, 10])
@pytest.mark.parametrize("shape", ["box", "sphere", "mesh"])
def test_substeps_balance_momentum(client: Any, shape: str, substeps: int) -> None:
    dt = 1 / 240
    client.setPhysicsEngineParameter(numSubSteps=substeps)
    floor(client)
    body = thing(client, shape, [0, 0, 0.12], orientation=turned(0.3, 0.2, 0.9), friction=0)
    world, steps = listen(client)
    error, loaded, several = 0.0, 0, 0
    for _ in range(200):
        before = np.array(client.getBaseVelocity(body)[0])
        client.stepSimulation()
        wanted = MASS_KG * (np.array(client.getBaseVelocity(body)[0]) - before) - MASS_KG * GRAVITY * dt
        error = max(error, np.abs(impulse_on(world, steps[-1], body) - wanted).max())
        loaded += bool(len(steps[-1].contacts))
        several += len(steps[-1].contacts) > 1
    assert loaded > 50
    assert several > 0
    assert error < 1e-6 * MASS_KG


def test_sliding_friction_is_close(client: Any) -> None:
    """The log has no friction: the last sub-step's ratio f/N stands for all, exact for what slides."""
    client.setPhysicsEngineParameter(numSubSteps=4)
    floor(client)
    body = thing(client, "box", [0, 0, 0.03], friction=0.5)
    client.resetBaseVelocity(body, [2, 0, 0])
    world, steps = listen(client)
    for _ in range(60):
        client.stepSimulation()
    drag = sum(impulse_on(world, step, body)[0] for step in steps)
    assert drag == pytest.approx(MASS_KG * (client.getBaseVelocity(body)[0][0] - 2), rel=0.05)


def test_log_survives_reset(client: Any) -> None:
    world, steps = None, []
    for _ in range(2):
        client.setGravity(0, 0, -9.81)
        client.setPhysicsEngineParameter(numSubSteps=4)
        floor(client)
        body = thing(client, "sphere", [0, 0, 0.05], friction=0)
        if world is None:
            world, steps = listen(client)
        for _ in range(60):
            client.stepSimulation()
        assert impulse_on(world, steps[-1], body)[2] == pytest.approx(MASS_KG * 9.81 / 240, rel=1e-3)
        client.resetSimulation()


def test_a_log_that_ends_is_named(client: Any) -> None:
    """Behind the listener's back (raw module), resetSimulation ends the log: never a silent third of the impulse."""
    client.setPhysicsEngineParameter(numSubSteps=4)
    floor(client)
    thing(client, "sphere", [0, 0, 0.05])
    world = open_world(client._client)
    client.stepSimulation()
    world.after_step()
    client.resetSimulation()
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(numSubSteps=4)
    floor(client)
    thing(client, "sphere", [0, 0, 0.05])
    with pytest.raises(SceneError, match="numSubSteps"):
        for _ in range(5):
            client.stepSimulation()
            world.after_step()
    world.unhook()


def test_substeps_set_too_late_are_named(client: Any) -> None:
    floor(client)
    thing(client, "sphere", [0, 0, 0.05])
    world = open_world(client._client)
    client.setPhysicsEngineParameter(numSubSteps=4)
    client.stepSimulation()
    with pytest.raises(SceneError, match="numSubSteps was set to 4"):
        world.after_step()
    client.stepSimulation()
    assert len(world.after_step().contacts)
    world.unhook()


def test_hit_keeps_its_sub_step_time(client: Any) -> None:
    """gap / approach, from the start of the step, is the time of the hit, whichever sub-step it fell into."""
    client.setPhysicsEngineParameter(numSubSteps=10)
    client.setGravity(0, 0, 0)
    floor(client)
    speed = 2.0
    for start in (0.0532, 0.0561, 0.0575):
        body = thing(client, "sphere", [0, 0, start])
        client.resetBaseVelocity(body, [0, 0, -speed])
        world, steps = listen(client)
        client.stepSimulation()
        rows = steps[0].contacts
        assert len(rows)
        assert rows.approach_m_s[0] == pytest.approx(speed)
        assert rows.gap_m[0] / rows.approach_m_s[0] == pytest.approx((start - 0.05) / speed, abs=1e-4)
        world.unhook()
        client.removeBody(body)
