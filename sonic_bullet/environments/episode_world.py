"""A PyBullet world that stores the records of the steps hidden in one env.step, and their lengths."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from fractions import Fraction
from typing import Any

import gymnasium

from sonic_bullet.environments.client_in_environment import REMEDY, client_in
from sonic_bullet.listener import PyBulletWorld, client_id_of, module_steps
from sonic_bullet.listener.quiet import quiet_stdout
from sonic_bullet.records.contacts import Step
from sonic_bullet.records.errors import SceneError
from sonic_bullet.synth.clock import exact_step


class EpisodeWorld(PyBulletWorld):
    """The world of a client. steps: those made since the list was last emptied."""

    def __init__(self, client: Any) -> None:
        super().__init__(client, client_id_of(client))
        self.steps: list[Step] = []
        self.hooked = False

    def listen(self, after: Callable[[], object]) -> bool:
        """Call ``after`` after every step of a BulletClient; return whether it is one."""
        self.hooked = super().listen(after)
        return self.hooked

    def after_step(self) -> Step:
        """Return the record of the step just made, and store it; raises SceneError."""
        step = super().after_step()
        if self.stepped:
            self.steps.append(step)
        return step

    def hearing(self, after: Callable[[], object]) -> AbstractContextManager[None]:
        """Call ``after`` after every step within the block, also where the client has no instance to hook."""
        return nullcontext() if self.hooked else module_steps(self.client_id, after)


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
        There is no PyBullet client, or env.step makes no physics step.
    """
    found = client_in(env) if client is None else client
    other = _another(env) if client is None and (found is None or hasattr(found, "_client")) else None
    if other is None:
        return _measured(env, client)
    try:
        return _measured(other, None)
    finally:
        other.close()


def connected_client(env: gymnasium.Env[Any, Any], client: Any) -> Any:
    """Return the client given, or the environment's own; SceneError where it has none."""
    found = client_in(env) if client is None else client
    if found is None:
        raise SceneError(f"the environment {env.unwrapped} has no PyBullet client", REMEDY)
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


def _measured(env: gymnasium.Env[Any, Any], client: Any) -> Fraction:
    env.reset()
    world = EpisodeWorld(connected_client(env, client))
    world.listen(world.after_step)
    try:
        with world.hearing(world.after_step):
            env.step(env.action_space.sample())
    finally:
        world.unhook()
    if not world.steps:
        raise SceneError("an env.step made no physics step", REMEDY + ", of the world that it steps")
    return sum((exact_step(step.dt_s) for step in world.steps), Fraction())
