"""A PyBullet world of episodes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from sonic_bullet.apps.environments.episode_steps import EpisodeWorld
from sonic_bullet.simulators import PyBulletWorld, client_id_of, module_steps


class PyBulletEpisodeWorld(EpisodeWorld, PyBulletWorld):
    """The world of a BulletClient, the pybullet module or a client id."""

    def __init__(self, client: Any) -> None:
        PyBulletWorld.__init__(self, client, client_id_of(client))
        self.steps, self._waited = [], []

    likeness = PyBulletWorld.likeness
    client = PyBulletWorld.client

    def listen_within(self, after: Callable[[], object]) -> AbstractContextManager[None]:
        """Call ``after`` after every step within the block, also where the client has no instance to hook."""
        return nullcontext() if self.hooked else module_steps(self.client_id, after)
