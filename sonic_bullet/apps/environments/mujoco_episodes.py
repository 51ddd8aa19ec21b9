"""A MuJoCo world of episodes."""

from __future__ import annotations

from typing import Any

from sonic_bullet.apps.environments.episode_steps import EpisodeWorld
from sonic_bullet.simulators.mujoco.mujoco_world import MujocoWorld


class MujocoEpisodeWorld(EpisodeWorld, MujocoWorld):
    """The world of a pair of MuJoCo's model and data."""

    def __init__(self, client: Any) -> None:
        MujocoWorld.__init__(self, *client)
        self.steps, self._waited = [], []
        self.client = client

    likeness = MujocoWorld.likeness
