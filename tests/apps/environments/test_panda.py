"""Unmodified environments of others, alone and in vectors: panda-gym hides 20 physics steps in each env.step."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.simulators.quiet import quiet_stdout
from tests.few_cases import parametrize_few
from tests.made.models import STEEL, WOOD
from tests.made.worlds import plate_model

gymnasium = pytest.importorskip("gymnasium")
pytest.importorskip("panda_gym")

from gymnasium.utils import env_checker  # noqa: E402

from sonic_bullet.apps.environments import SoundObservation  # noqa: E402
from tests.made.environments import FallingBox, plates  # noqa: E402

STEPS = 200
TABLE, CUBE = 2, 3
MATERIALS = {
    TABLE: {"material": WOOD, "model": plate_model(WOOD)},
    CUBE: {"material": STEEL, "model": plate_model()},
}
HOW: dict[str, Any] = {"microphones": ((0.0, -1.0, 0.5), (0.3, 0.0, 0.5)), "materials": MATERIALS}


def bare(name: str = "PandaPush-v3") -> Any:
    with quiet_stdout():  # PyBullet prints its arguments
        return gymnasium.make(name, max_episode_steps=10 * STEPS)


def sounding() -> Any:
    return SoundObservation(bare(), **HOW)


def actions(seed: int, count: int = STEPS) -> np.ndarray:
    """Towards the cube, and down."""
    drawn = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    drawn[:, 2] -= 0.3
    return np.clip(drawn, -1, 1).astype(np.float32)


def attached(seed: int) -> np.ndarray:
    """What attach gives in the bare environment, float32 (steps, channels, samples)."""
    env = bare()
    env.reset(seed=seed)
    with sb.attach(env.unwrapped.sim.physics_client, microphone=HOW["microphones"]) as listener:
        listener.add_all(MATERIALS)
        frames = []
        for action in actions(seed):
            env.step(action)
            frames.append(listener.read())
    env.close()
    return np.stack(frames).astype(np.float32)


@pytest.fixture(scope="module")
def expected() -> list[np.ndarray]:
    return [attached(seed) for seed in (0, 1)]


@pytest.fixture
def env() -> Iterator[Any]:
    made = sounding()
    yield made
    made.close()


@pytest.mark.slow
def test_it_is_the_bare_environment_with_attach(env: Any, expected: list[np.ndarray]) -> None:
    assert env.step_s * 500 == 20
    assert set(env.observation_space) == {"observation", "achieved_goal", "desired_goal", "audio"}
    other = bare()
    start, start_of_other = env.reset(seed=0)[0], other.reset(seed=0)[0]
    assert not start["audio"].any()
    for action, audio in zip(actions(0), expected[0], strict=True):
        observation, reward, *_, info = env.step(action)
        assert info["audio_count"] == 1920 and "contacts_differ" not in info
        np.testing.assert_array_equal(observation["audio"], audio)
        plain, plain_reward, *_ = other.step(action)
        np.testing.assert_array_equal(observation["observation"], plain["observation"])
        assert reward == plain_reward
    np.testing.assert_array_equal(start["observation"], start_of_other["observation"])
    assert np.abs(expected[0]).max() > 1e-3
    assert env.observation_space.contains(observation)
    other.close()


@pytest.mark.slow
def test_another_seed_between_makes_other_contacts_and_says_so(env: Any, expected: list[np.ndarray]) -> None:
    """PyBullet's contact cache outlives panda-gym's reset."""
    count = 60
    same = differ = 0
    for number, seed in enumerate((0, 0, 1, 0)):
        env.reset(seed=seed)
        for action, audio in zip(actions(seed)[:count], expected[seed], strict=False):
            observation, *_, info = env.step(action)
            if "contacts_differ" in info:
                assert number == 3
                differ += 1
            elif seed == 0:
                same += 1
                np.testing.assert_array_equal(observation["audio"], audio)
    assert same >= 2 * count and same + differ == 3 * count
    print(f"{differ} of {count} env.steps met other contacts")


@pytest.mark.slow
def test_a_vector_in_one_process(expected: list[np.ndarray]) -> None:
    check_vector(gymnasium.vector.SyncVectorEnv([sounding, sounding]), expected)


@pytest.mark.slow
@parametrize_few("context", ["fork", "spawn"], 1)
def test_a_vector_of_processes(context: str, expected: list[np.ndarray]) -> None:
    assert context in multiprocessing.get_all_start_methods()
    check_vector(gymnasium.vector.AsyncVectorEnv([sounding, sounding], context=context), expected)


def check_vector(vector: Any, expected: list[np.ndarray]) -> None:
    try:
        observation, _ = vector.reset(seed=[0, 1])
        assert observation["audio"].shape == (2, 2, 1920) and not observation["audio"].any()
        both = np.stack([actions(0), actions(1)], axis=1)
        for number, action in enumerate(both):
            observation, _, terminated, truncated, info = vector.step(action)
            assert not terminated.any() and not truncated.any()  # else the next step is a reset
            np.testing.assert_array_equal(info["audio_count"], [1920, 1920])
            for audio, alone in zip(observation["audio"], expected, strict=True):
                np.testing.assert_array_equal(audio, alone[number])
        assert number == STEPS - 1 and all(np.abs(alone).max() > 1e-3 for alone in expected)
    finally:
        vector.close()


CHECKS = (
    "check_seed_deprecation",
    "check_reset_return_info_deprecation",
    "check_reset_return_type",
    "check_reset_seed_determinism",
    "check_reset_options",
    "env_reset_passive_checker",
    "check_step_determinism",
    "check_returned_data_not_reused",
)


def failures(env: Any) -> dict[str, str]:
    """What of `check_env`, and of its parts one by one, an environment fails, and how."""
    found = {}
    for name in ("check_env", *CHECKS):
        check = getattr(env_checker, name, None)
        if check is None:  # an older gymnasium has fewer
            continue
        try:
            check(env, **({"skip_render_check": True} if name == "check_env" else {}))
        except AssertionError as error:
            found[name] = str(error)
    return found


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["PandaPush-v3", "PandaReach-v3"])
def test_the_checker_finds_what_it_finds_in_the_bare_environment(name: str) -> None:
    plain, env = bare(name), SoundObservation(bare(name), materials={})
    assert failures(env) == failures(plain)
    plain.close(), env.close()


@pytest.mark.filterwarnings("ignore")
def test_the_checker_finds_nothing_in_an_environment_without_fault() -> None:
    gymnasium.register("FallingBox-v0", lambda: FallingBox(renew=True))
    try:
        env = SoundObservation(gymnasium.make("FallingBox-v0"), materials=plates)
        assert failures(gymnasium.make("FallingBox-v0")) == {}
        assert failures(env) == {}
        assert env.spec is not None
        again = gymnasium.make(env.spec)  # the wrapper is part of it
        assert again.observation_space == env.observation_space
        again.close(), env.close()
    finally:
        with suppress(KeyError):
            del gymnasium.registry["FallingBox-v0"]
