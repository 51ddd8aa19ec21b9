"""Open an environment's world, and measure the simulated time of one env.step."""

from __future__ import annotations

from copy import deepcopy
from fractions import Fraction
from typing import Any

import gymnasium

from sonic_bullet.apps.environments.client_in_environment import GIVE_CLIENT, client_in
from sonic_bullet.apps.environments.episode_steps import EpisodeWorld
from sonic_bullet.engine.runtime.clock import exact_step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.opening import is_mujoco
from sonic_bullet.simulators.quiet import quiet_stdout


def episode_world(client: Any) -> EpisodeWorld:
    """Open the world of a PyBullet client or of MuJoCo's (model, data); raises SceneError."""
    if is_mujoco(client):
        from sonic_bullet.apps.environments.mujoco_episodes import MujocoEpisodeWorld

        return MujocoEpisodeWorld(client)

    from sonic_bullet.apps.environments.pybullet_episodes import PyBulletEpisodeWorld

    return PyBulletEpisodeWorld(client)


def same_client(one: Any, other: Any) -> bool:
    """Tell whether two clients are one: the same object, or pairs of the same model and data."""
    if is_mujoco(one) and is_mujoco(other):
        return one[0] is other[0] and one[1] is other[1]
    return one is other


def step_length(env: gymnasium.Env[Any, Any], client: Any) -> Fraction:
    """Measure the simulated time of one env.step in s, by the steps that it holds.

    It is measured on another environment made by the same spec, so that this one stays as it was: PyBullet keeps
    contacts over a reset, and one step more would change an episode. Without a spec, or where the client was given or
    is a bare id, which others may use as well, this one is reset and stepped once.

    Parameters
    ----------
    client
        Given by the user, or None.

    Raises
    ------
    SceneError
        There is no client, or env.step makes no physics step.
    """
    found = client_in(env) if client is None else client
    is_own = found is None or hasattr(found, "_client") or is_mujoco(found)
    other = _another(env) if client is None and is_own else None
    if other is None:
        return _measure_step(env, client)
    try:
        return _measure_step(other, None)
    finally:
        other.close()


def connected_client(env: gymnasium.Env[Any, Any], client: Any) -> Any:
    """Return the client given, or the environment's own; SceneError where it has none."""
    found = client_in(env) if client is None else client
    if found is None:
        raise SceneError(
            f"the environment {env.unwrapped} has no PyBullet client and no MuJoCo model and data", GIVE_CLIENT
        )
    return found


def _another(env: gymnasium.Env[Any, Any]) -> gymnasium.Env[Any, Any] | None:
    """Make an environment like this one without a window, or return None where that fails."""
    try:
        spec = deepcopy(env.spec)
        if spec is None:
            return None
        if spec.kwargs.get("render_mode") == "human":
            del spec.kwargs["render_mode"]
        with quiet_stdout():
            return gymnasium.make(spec)
    except Exception:  # a constructor may raise anything; the first environment is used then
        return None


def _measure_step(env: gymnasium.Env[Any, Any], client: Any) -> Fraction:
    env.reset()
    world = episode_world(connected_client(env, client))
    world.listen(world.after_step)
    try:
        with world.listen_within(world.after_step):
            env.step(env.action_space.sample())
    finally:
        world.unhook()
    if not world.steps:
        raise SceneError("an env.step made no physics step", GIVE_CLIENT + ", of the world that it steps")
    return sum((exact_step(step.dt_s) for step in world.steps), Fraction())
