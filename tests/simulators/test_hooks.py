"""Hooks: on the instance alone, off without a trace, through gym environments."""

from __future__ import annotations

import gc
import itertools
from typing import Any

import pybullet as p
import pytest

from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators import open_world
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
    from sonic_bullet.simulators import direct_client, disconnect

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


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_hooks_of_one_client_leave_in_any_order_without_a_trace(client: Any, order: tuple[int, ...]) -> None:
    observed = [0, 0, 0]
    before = dict(vars(client))

    def hear(which: int) -> None:
        observed[which] += 1

    worlds = [open_world(client) for _ in observed]
    for which, world in enumerate(worlds):
        world.hook(world.before_step, lambda which=which: hear(which))
    for which in order:
        client.stepSimulation()
        worlds[which].unhook()
    client.stepSimulation()
    assert [observed[which] for which in order] == [1, 2, 3]
    assert dict(vars(client)) == before


def test_one_that_leaves_and_comes_again_is_told_once(client: Any) -> None:
    first, told = listen(client)
    second, _ = listen(client)
    first.unhook()
    first.hook(first.before_step, lambda: told.append(first.after_step()))
    client.stepSimulation()
    assert len(told) == 1
    second.unhook()
    first.unhook()
    assert "stepSimulation" not in vars(client)


def test_both_are_told_of_removals_and_moves(client: Any) -> None:
    floor(client)
    body = thing(client, "box", [0, 0, 0.03])
    worlds = [listen(client) for _ in range(2)]
    client.stepSimulation()
    client.resetBasePositionAndOrientation(body, [0, 0, 0.031], [0, 0, 0, 1])
    client.stepSimulation()
    for world, steps in worlds:
        assert steps[-1].teleported[world.index_of(body)]
    client.removeBody(body)
    assert [world.index_of(body) for world, _ in worlds] == [-1, -1]


def test_a_hook_of_someone_else_over_ours_keeps_working_when_all_have_left(client: Any) -> None:
    world, steps = listen(client)
    ours, called = client.stepSimulation, []

    def theirs() -> None:
        called.append(1)
        ours()

    client.stepSimulation = theirs
    later, more = listen(client)
    client.stepSimulation()
    world.unhook()
    client.stepSimulation()
    later.unhook()
    client.stepSimulation()
    assert client.stepSimulation is theirs
    assert (len(steps), len(more), len(called)) == (1, 2, 3)


@pytest.mark.parametrize("listeners", [1, 2])
def test_a_client_dropped_without_detach_disconnects_at_once(listeners: int) -> None:
    """Without the garbage collector: nothing of ours holds it, though the listener lives on with what it heard."""
    import sonic_bullet as sb
    from sonic_bullet.simulators import direct_client

    gc.collect()
    gc.disable()
    try:
        client = direct_client()
        client.setGravity(0, 0, -9.81)
        floor(client)
        thing(client, "box", [0, 0, 0.03])
        kept = [sb.attach(client) for _ in range(listeners)]
        for _ in range(10):
            client.stepSimulation()
        client_id = client._client
        del client
        assert not p.isConnected(client_id)
        assert kept[0].sound().shape == (1, 2000)
        with pytest.raises(SceneError, match=r"does not answer|not connected"):
            kept[0].step()
        kept[0].detach()
        kept[-1].detach()
    finally:
        gc.enable()


def test_a_listener_of_a_dropped_client_leaves_the_next_one_of_that_id_alone(client: Any) -> None:
    from sonic_bullet.simulators import direct_client, disconnect

    old = direct_client()
    old.setPhysicsEngineParameter(numSubSteps=4)
    world, _ = listen(old)
    old.stepSimulation()
    client_id = old._client
    del old
    new = direct_client()
    assert new._client == client_id, "the id is given anew: the test tests something"
    new.setPhysicsEngineParameter(numSubSteps=4)
    new.setGravity(0, 0, -9.81)
    other, steps = listen(new)
    floor(new)
    thing(new, "box", [0, 0, 0.03])
    world.unhook()
    for _ in range(5):
        new.stepSimulation()
    assert len(steps) == 5
    assert len(steps[-1].contacts) > 0
    other.unhook()
    disconnect(new)
