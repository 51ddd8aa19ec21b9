"""From a gymnasium environment to what an agent hears of it."""

from __future__ import annotations

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from sonic_bullet.apps.environments import SoundObservation  # noqa: E402
from tests.made.environments import FallingBox, plates  # noqa: E402


def test_fifty_steps_are_heard_and_lie_in_the_space() -> None:
    environment = SoundObservation(FallingBox(), microphones=((0.0, -1.0, 0.5),), materials=plates)
    try:
        observation, _ = environment.reset(seed=1)
        assert environment.observation_space.contains(observation)
        loudest = 0.0
        for _ in range(50):
            observation, *_ = environment.step(np.zeros(3, np.float32))
            assert environment.observation_space.contains(observation)
            loudest = max(loudest, float(np.abs(observation["audio"]).max()))
        assert loudest > 20e-6  # the threshold of hearing
    finally:
        environment.close()
