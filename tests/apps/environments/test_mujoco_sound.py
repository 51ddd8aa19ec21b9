"""gymnasium's MuJoCo environments with sound: the bare environment, its step's sound, the same bytes again."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.records.errors import SceneError
from tests.made.models import STEEL
from tests.made.mujoco_models import DROPPED, made
from tests.made.worlds import plate_model

gymnasium = pytest.importorskip("gymnasium")
mujoco = pytest.importorskip("mujoco")

from gymnasium.utils import env_checker  # noqa: E402

from sonic_bullet.apps.environments import SoundObservation  # noqa: E402

FOOT = {"material": STEEL, "model": plate_model()}
FEET = {"right_foot": FOOT, "left_foot": FOOT}


def humanoid(**how: Any) -> Any:
    return gymnasium.make("Humanoid-v5", terminate_when_unhealthy=False, **how)


@pytest.fixture
def env() -> Iterator[Any]:
    wrapped = SoundObservation(humanoid(), materials=FEET, microphones=((0.0, -1.0, 1.0), (0.0, 1.0, 1.0)))
    yield wrapped
    wrapped.close()


def episode(env: Any, seed: int, count: int) -> list[Any]:
    env.reset(seed=seed)
    env.action_space.seed(seed)
    return [env.step(env.action_space.sample()) for _ in range(count)]


def test_it_is_the_bare_environment_with_sound(env: Any) -> None:
    """RK4, five hidden steps of 3 ms: observations keep every bit, samples add up, an episode repeats its bytes."""
    assert env.step_s * 1000 == 15
    steps = episode(env, 3, 40)
    for (one, reward, *_, info), (two, same, *_) in zip(steps, episode(humanoid(), 3, 40), strict=True):
        assert np.array_equal(one["observation"], two)
        assert reward == same
        assert one["audio"].shape == (2, 720)
        assert info["audio_count"] <= 720
    assert sum(info["audio_count"] for *_, info in steps) == 40 * 720
    audio = np.concatenate([one["audio"] for one, *_ in steps], axis=1)
    assert np.abs(audio).max() > 1e-4
    again = episode(env, 3, 40)
    assert np.array_equal(audio, np.concatenate([one["audio"] for one, *_ in again], axis=1))
    assert not any("contacts_differ" in info for *_, info in again)


def test_gymnasiums_checker_passes(env: Any) -> None:
    env_checker.check_env(env, skip_render_check=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["Humanoid-v5", "HalfCheetah-v5"])
def test_a_thousand_steps_sound_and_balance(name: str) -> None:
    """All that touches, as plastic: what gymnasium's own environments do for 1000 env.steps is finite and sounds."""
    env = SoundObservation(gymnasium.make(name), materials="plastic")
    env.reset(seed=0)
    env.action_space.seed(0)
    loudest = 0.0
    for _ in range(1000):
        observation, _, ended, cut, _ = env.step(env.action_space.sample())
        assert np.isfinite(observation["audio"]).all()
        loudest = max(loudest, float(np.abs(observation["audio"]).max()))
        if ended or cut:
            env.reset()
    assert 1e-3 < loudest < 1e3
    env.close()


class Rolling(gymnasium.Env[Any, Any]):
    """A ball on a plate, pushed; one step of 1/240 s each."""

    def __init__(self) -> None:
        self.model, self.data = made(DROPPED["ball"], timestep=1 / 240)
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (7,), np.float64)
        self.action_space = gymnasium.spaces.Box(-0.2, 0.2, (3,), np.float32)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        return self.data.qpos.copy(), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.data.xfrc_applied[1, :3] = action - 0.05 * self.data.qpos[:3] * [1, 1, 0]
        mujoco.mj_step(self.model, self.data)
        return self.data.qpos.copy(), 0.0, False, False, {}


@pytest.mark.slow
@pytest.mark.timeout(1500)
def test_a_hundred_thousand_steps_of_183_samples_and_three_quarters() -> None:
    """One shape, and counts that sum to floor(sr · time) at every step."""
    env = SoundObservation(Rolling(), sr=44_100, materials={"thing": FOOT})
    env.reset(seed=0)
    rng, total, loudest = np.random.default_rng(0), 0, 0.0
    for step in range(1, 100_001):
        observation, *_, info = env.step(rng.uniform(-0.2, 0.2, 3))
        audio = observation["audio"]
        assert audio.shape == (1, 184)
        total += info["audio_count"]
        assert total == step * 735 // 4
        loudest = max(loudest, float(np.abs(audio).max()))
    assert loudest > 1e-4
    env.close()


def test_a_time_step_that_changes_and_a_client_that_is_none_are_one_line(env: Any) -> None:
    episode(env, 0, 1)
    env.unwrapped.model.opt.timestep = 0.0015
    with pytest.raises(SceneError, match=r"changed its time step from 0.003 s to 0.0015 s; keep one time step"):
        env.step(env.action_space.sample())
    with pytest.raises(SceneError, match="no PyBullet client and no MuJoCo model and data; give client="):
        SoundObservation(gymnasium.make("CartPole-v1"))


def test_all_that_touches_sounds_of_one_material(env: Any) -> None:
    from sonic_bullet.apps.environments.sounding_cast import cast_of

    client = (env.unwrapped.model, env.unwrapped.data)
    material = sb.load_material("plastic")
    assert len(cast_of(material, client)) == 14
    assert list(cast_of({"torso": "wood", (3, -1): "wood"}, client)) == [("torso", -1), (3, -1)]
