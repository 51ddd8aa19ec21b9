"""Hooks: on the instance alone, off without a trace, through gym environments."""

from __future__ import annotations

from typing import Any

import pybullet as p
import pytest

from sonic_bullet.listener import open_world
from sonic_bullet.records.errors import SceneError
from tests.made.scenes import floor, listen, thing


def test_unhook_restores_the_client_exactly(client: Any) -> None:
    before = dict(vars(client))
    world, steps = listen(client)
    client.stepSimulation()
    world.unhook()
    assert vars(client) == before
    world.unhook()
    client.stepSimulation()
    assert len(steps) == 1


def test_a_hook_of_someone_else_still_runs_and_comes_back(client: Any) -> None:
    called = []

    def theirs() -> None:
        called.append(1)
        p.stepSimulation(physicsClientId=client._client)

    client.stepSimulation = theirs
    world, steps = listen(client)
    client.stepSimulation()
    world.unhook()
    assert client.stepSimulation is theirs
    assert called == [1] and len(steps) == 1


def test_other_clients_are_not_heard(client: Any) -> None:
    from sonic_bullet.listener import direct_client, disconnect

    _, steps = listen(client)
    other = direct_client()
    other.stepSimulation()
    disconnect(other)
    assert not steps


def test_the_module_cannot_be_hooked(client: Any) -> None:
    world = open_world(client._client)
    with pytest.raises(SceneError, match="cannot be hooked"):
        world.hook(world.before_step, world.after_step)


def test_keywords_reach_the_hooked_functions(client: Any) -> None:
    floor(client)
    body = thing(client, "box", [0, 0, 0.03])
    world, steps = listen(client)
    for _ in range(3):
        client.stepSimulation()
    client.resetBasePositionAndOrientation(bodyUniqueId=body, posObj=[0, 0, 0.031], ornObj=[0, 0, 0, 1])
    client.stepSimulation()
    assert steps[-1].teleported[world.index_of(body)]
    client.removeBody(bodyUniqueId=body)
    assert world.index_of(body) == -1


def test_unmodified_gym_environments_are_heard_to_the_last_step() -> None:
    """panda-gym hides 20 physics steps in each env.step."""
    gymnasium = pytest.importorskip("gymnasium")
    pytest.importorskip("panda_gym")
    env = gymnasium.make("PandaPush-v3")
    env.reset(seed=1)
    world, steps = listen(env.unwrapped.sim.physics_client)
    for k in range(6):
        env.step(env.action_space.sample())
        assert len(steps) == 20 * (k + 1)
    assert sum(len(s.contacts) for s in steps) > 50
    env.reset(seed=2)
    env.step(env.action_space.sample())
    world.unhook()
    env.close()


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_two_hooks_on_one_client_leave_in_any_order(client: Any, order: tuple[int, int]) -> None:
    observed = [0, 0]
    before = dict(vars(client))

    def hear(which: int) -> None:
        observed[which] += 1

    worlds = [open_world(client) for _ in observed]
    for which, world in enumerate(worlds):
        world.hook(world.before_step, lambda which=which: hear(which))
    client.stepSimulation()
    worlds[order[0]].unhook()
    client.stepSimulation()
    worlds[order[1]].unhook()
    client.stepSimulation()
    assert observed[order[0]] == 1
    assert observed[order[1]] == 2
    if order == (1, 0):
        assert dict(vars(client)) == before
