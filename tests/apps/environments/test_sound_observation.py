"""An environment's sound: what attach would have given, sample by sample, episode by episode."""

from __future__ import annotations

import gc
import subprocess
import sys
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.engine.runtime.clock import Clock, exact_step
from sonic_bullet.records.errors import AudioError, MaterialError, RecordError, SceneError, SceneWarning
from sonic_bullet.session.drawn_recording import ChainSpread, draw_chain, record
from sonic_bullet.simulators import direct_client, disconnect

gymnasium = pytest.importorskip("gymnasium")

from sonic_bullet.apps.environments import SoundObservation, sound_observation  # noqa: E402
from sonic_bullet.apps.environments.sounding_cast import cast_of  # noqa: E402
from tests.made.environments import DT_S, PLATE, Empty, FallingBox, NumberedBox, plates  # noqa: E402
from tests.made.jointed import arm_cast, tap_arm  # noqa: E402
from tests.made.models import STEEL, ball_body  # noqa: E402

MICROPHONES = ((0.0, -1.0, 0.5), (0.5, 0.0, 0.5))


@pytest.fixture
def opened() -> Iterator[Callable[[Any], Any]]:
    """Closes at the end what it was given."""
    environments: list[Any] = []

    def keep(environment: Any) -> Any:
        environments.append(environment)
        return environment

    yield keep
    for environment in environments:
        environment.close()


def actions(env: Any, count: int, seed: int = 0) -> list[Any]:
    env.action_space.seed(seed)
    return [env.action_space.sample() for _ in range(count)]


def episode(env: Any, seed: int, count: int = 40) -> tuple[np.ndarray, list[dict[str, Any]]]:
    """All new samples of an episode, (channels, n), and the infos."""
    env.reset(seed=seed)
    new, infos = [], []
    for action in actions(env, count, seed):
        observation, *_, info = env.step(action)
        audio = observation["audio"]
        assert not audio[:, : audio.shape[1] - info["audio_count"]].any()
        new.append(audio[:, audio.shape[1] - info["audio_count"] :])
        infos.append(info)
    return np.concatenate(new, axis=1), infos


def attached(env: Any, seed: int, count: int = 40, **how: Any) -> np.ndarray:
    """The same episode of a bare environment, listened to by attach."""
    env.reset(seed=seed)
    client = env.unwrapped.physics
    with sb.attach(client, **how) as listener:
        listener.add_all(plates(client))
        for action in actions(env, count, seed):
            env.step(action)
        return listener.read().astype(np.float32)


def test_a_box_is_observed_as_a_key_beside_audio(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), 44_100, microphones=MICROPHONES, materials=plates))
    assert set(env.observation_space) == {"audio", "observation"}
    assert env.step_s == 4 * exact_step(DT_S)
    assert env.observation_space["audio"].shape == (2, 735)
    assert env.observation_space["audio"].dtype == np.float32
    observation, info = env.reset(seed=0)
    assert info["audio_count"] == 0 and not observation["audio"].any()
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.step(np.zeros(3, np.float32))[0])


def test_a_dict_keeps_its_keys(opened: Any) -> None:
    env = opened(SoundObservation(Empty(), materials={}))
    assert set(env.observation_space) == set(env.reset()[0]) == {"nothing", "audio"}


class CountedListener:
    """What SoundObservation needs of a listener, without sound: frames as long as the run time's clock says."""

    def __init__(self, world: Any, *, sr: int, **_: Any) -> None:
        self.clock, self.sr, self.world, self.unread = Clock(), sr, world, 0
        world.listen(self.step)

    def add_all(self, cast: Any) -> None:
        assert cast == {}

    def step(self) -> None:
        self.world.after_step()
        later = self.clock.after(DT_S)
        self.unread += later.sample(self.sr) - self.clock.sample(self.sr)
        self.clock = later

    def together(self) -> AbstractContextManager[None]:
        return nullcontext()

    def read(self) -> np.ndarray:
        count, self.unread = self.unread, 0
        return np.ones((1, count))

    def detach(self) -> None:
        self.world.unhook()


@pytest.mark.slow
@pytest.mark.parametrize(("listener", "steps"), [(sb.attach, 2_000), (CountedListener, 100_000)])
def test_counts_add_up_to_the_samples_of_all_steps(
    opened: Any, monkeypatch: pytest.MonkeyPatch, listener: Any, steps: int
) -> None:
    """44.1 kHz and 240 Hz: 183.75 samples a step; with sound itself benchmarks/environment_steps.py counts as far."""
    monkeypatch.setattr(sound_observation, "attach", listener)
    env = opened(SoundObservation(Empty(), 44_100, materials={}))
    assert env.observation_space["audio"].shape == (1, 184)
    env.reset()
    total = 0
    for k in range(1, steps + 1):
        observation, *_, info = env.step(0)
        total += info["audio_count"]
        assert info["audio_count"] in (183, 184)
        assert total == 44_100 * k // 240
        if listener is CountedListener and k % 97 == 0:
            assert observation["audio"].sum() == info["audio_count"]
            assert observation["audio"][0, 0] == info["audio_count"] - 183
    assert total == 44_100 * steps // 240


@pytest.mark.parametrize("renew", [False, True], ids=["moved", "made anew"])
def test_it_is_what_attach_gives(opened: Any, renew: bool) -> None:
    how = {"sr": 44_100, "air": sb.Air(density_kg_m3=1.0, sound_speed_m_s=340.0)}
    env = opened(SoundObservation(FallingBox(renew=renew), microphones=MICROPHONES, materials=plates, **how))
    bare = opened(FallingBox(renew=renew))
    for seed in (0, 1):
        audio, infos = episode(env, seed)
        expected = attached(bare, seed, microphone=MICROPHONES, **how)
        np.testing.assert_array_equal(audio, expected)
        assert sum(info["audio_count"] for info in infos) == 44_100 * 160 // 240
        assert np.abs(audio).max() > 1e-3


def test_a_client_known_by_its_number_is_listened_to(opened: Any) -> None:
    step = p.stepSimulation
    env = opened(SoundObservation(NumberedBox(), materials=plates))
    audio, _ = episode(env, 0)
    assert p.stepSimulation is step
    assert np.abs(audio).max() > 1e-3
    bare = opened(NumberedBox())
    bare.reset(), bare.step(np.zeros(3, np.float32))  # the step by which T was measured
    bare.reset(seed=0)
    with sb.attach(bare._physics_client_id) as listener:
        listener.add_all(plates(None))
        bare.hidden = 1
        for action in actions(bare, 40, 0):
            for _ in range(4):
                bare.step(action)
                listener.step()
        np.testing.assert_array_equal(audio, listener.read().astype(np.float32))


def test_a_listener_begins_anew_while_its_bodies_stay_and_sound_the_same(opened: Any) -> None:
    materials: dict[Any, Any] = {1: {"material": STEEL, "model": PLATE}}
    env = opened(SoundObservation(FallingBox(), materials=lambda client: materials))
    env.reset()
    listener = env.listener
    env.reset()
    assert env.listener is listener
    materials = {1: {"material": STEEL, "model": PLATE, "roughness_m": 1e-5}}
    env.reset()
    assert env.listener is not listener


@pytest.mark.parametrize("renew", [False, True], ids=["moved", "made anew"])
def test_a_seed_gives_the_same_bytes_or_says_that_contacts_differ(opened: Any, renew: bool) -> None:
    env = opened(SoundObservation(FallingBox(renew=renew), materials=plates))
    first, infos = episode(env, 7)
    assert not any("contacts_differ" in info for info in infos)
    episode(env, 8)
    for _ in range(2):
        again, infos = episode(env, 7)
        differ = ["contacts_differ" in info for info in infos]
        until = sum(info["audio_count"] for info, other in zip(infos, differ, strict=True) if not other)
        np.testing.assert_array_equal(again[:, :until], first[:, :until])
        assert differ == sorted(differ)  # once it is said it stays
    if renew:
        assert not any(differ)


def test_contacts_that_differ_are_named(opened: Any) -> None:
    """The same seed and actions, another friction: the contacts are others, and so is the sound."""
    env = opened(SoundObservation(FallingBox(renew=True), materials=plates))
    first, _ = episode(env, 7)
    env.unwrapped.dt_s = DT_S
    build = env.unwrapped.build

    def bouncier() -> None:
        build()
        env.unwrapped.physics.changeDynamics(env.unwrapped.body, -1, restitution=0.1)

    env.unwrapped.build = bouncier
    again, infos = episode(env, 7)
    assert not np.array_equal(first, again)
    differ = [info.get("contacts_differ") for info in infos]
    assert differ[0] is None and differ[-1] is True  # the fall is the same, the impact is not
    episode(env, 9)
    assert not any("contacts_differ" in info for info in episode(env, 11)[1])  # nothing to compare with


@pytest.mark.parametrize("leave", [False, True], ids=["ends the last", "leaves it"])
def test_a_client_may_come_with_reset(opened: Any, leave: bool) -> None:
    """Many environments connect when first reset; some do so each time."""

    class Late(FallingBox):
        def connect(self) -> None:
            pass

        def build(self) -> None:
            pass

        def reset(self, **how: Any) -> Any:
            if hasattr(self, "physics") and not leave:
                disconnect(self.physics)
            FallingBox.connect(self), FallingBox.build(self)
            return super().reset(**how)

    env = opened(SoundObservation(Late(), materials=plates))
    first, again = episode(env, 0)[0], episode(env, 0)[0]
    assert first.any()
    np.testing.assert_array_equal(first, again)
    bare = opened(FallingBox())
    np.testing.assert_array_equal(first, attached(bare, 0))


def test_names_find_bodies_again(opened: Any) -> None:
    bare = opened(FallingBox(renew=True))
    how = {"material": STEEL, "model": PLATE}
    assert cast_of({"link0": "wood", (1, "all"): "glass"}, bare.physics) == {
        (0, -1): "wood",
        (1, -1): "wood",
        (1, "all"): "glass",
    }
    env = opened(SoundObservation(FallingBox(renew=True), materials={("link0", -1): how}))
    first, _ = episode(env, 0)
    listener = env.listener
    np.testing.assert_array_equal(episode(env, 0)[0], first)
    assert env.listener is not listener  # the bodies are others
    assert {body.material.name for body in env.listener.world.bodies} == {STEEL.name}
    env = opened(SoundObservation(FallingBox(renew=True), materials={"body 1": {"material": STEEL}}))
    with pytest.raises(SceneError, match="no body is called 'body 1'"):
        env.reset(seed=0)


def test_nobody_is_found_without_pybullet(opened: Any) -> None:
    env = opened(gymnasium.make("CartPole-v1"))
    with pytest.raises(SceneError, match="has no PyBullet client"):
        SoundObservation(env)


def test_two_clients_are_one_too_many(opened: Any) -> None:
    bare = opened(FallingBox())
    bare.other = opened(FallingBox()).physics
    with pytest.raises(SceneError, match="2 PyBullet clients; give client="):
        SoundObservation(bare, materials=plates)
    env = SoundObservation(bare, materials=plates, client=bare.physics)
    assert episode(env, 0)[0].any()


def test_a_changed_time_step_is_one_line(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), materials=plates))
    episode(env, 0, 3)
    env.unwrapped.physics.setTimeStep(1 / 480)
    with pytest.raises(SceneError, match=r"changed its time step from 0\.00416667 s to 0\.00208333 s"):
        env.step(np.zeros(3, np.float32))


def test_a_step_longer_than_the_audio_is_one_line(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), materials=plates))
    env.reset(seed=0)
    env.unwrapped.hidden = 5
    with pytest.raises(SceneError, match=r"5 physics steps, and its audio holds 4; give step_s=, .*: 0\.0208333"):
        env.step(np.zeros(3, np.float32))
    env.unwrapped.hidden = 4
    env.unwrapped.physics.stepSimulation()  # heard, and in nobody's observation
    assert env.step(np.zeros(3, np.float32))[4]["audio_count"] == 800
    longer = opened(SoundObservation(FallingBox(hidden=5), materials=plates, step_s=0.05))
    assert longer.observation_space["audio"].shape == (1, 2400)
    assert {info["audio_count"] for info in episode(longer, 0, 4)[1]} == {1000}


@pytest.mark.parametrize(
    ("how", "error", "text"),
    [
        ({"microphones": ()}, AudioError, "no microphone"),
        ({"sr": 7}, AudioError, "sample rate"),
        ({"materials": "cheese"}, MaterialError, "cheese"),
        ({"seed": -1}, RecordError, "seed is -1"),
        ({"air": 1.2}, RecordError, "air is 1.2"),
        ({"step_s": 0}, SceneError, "step_s is 0"),
        ({"client": "me"}, SceneError, "client is 'me'"),
    ],
)
def test_arguments_are_checked_at_the_door(opened: Any, how: dict[str, Any], error: Any, text: str) -> None:
    with pytest.raises(error, match=text):
        SoundObservation(opened(FallingBox()), **{"materials": plates, **how})


def test_it_wraps_once(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), materials=plates))
    with pytest.raises(SceneError, match="has 'audio' already"):
        SoundObservation(env, materials=plates)


def test_where_bodies_cannot_sound_nothing_is_left_attached(opened: Any) -> None:
    bare = opened(FallingBox())
    before = dict(vars(bare.physics))
    env = SoundObservation(bare, materials={7: "wood"})
    with pytest.raises(SceneError, match="no body 7"):
        env.reset()
    assert dict(vars(bare.physics)) == before
    with pytest.raises(SceneError, match="call reset first"):
        env.step(np.zeros(3, np.float32))


def test_steps_want_an_episode(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), materials=plates))
    with pytest.raises(SceneError, match="call reset first"):
        env.step(np.zeros(3, np.float32))


def test_a_function_returns_a_mapping(opened: Any) -> None:
    env = opened(SoundObservation(FallingBox(), materials=lambda client: [1]))
    with pytest.raises(SceneError, match="return a dict"):
        env.reset()


def test_closing_leaves_the_client_as_it_was() -> None:
    bare = FallingBox()
    before = dict(vars(bare.physics))
    env = SoundObservation(bare, materials=plates)
    assert dict(vars(bare.physics)) == before  # measuring T leaves nothing either
    episode(env, 0, 3)
    assert dict(vars(bare.physics)) != before
    close, closed = bare.close, []
    bare.close = lambda: closed.append(dict(vars(bare.physics)))  # type: ignore[method-assign]
    env.close(), env.close()
    assert closed == [before, before]
    close()


@pytest.mark.slow
def test_episodes_leave_no_memory_behind(opened: Any) -> None:
    """A world that is made anew each time, one step each; benchmarks/environment_steps.py counts all memory."""
    env = opened(SoundObservation(FallingBox(renew=True), materials=plates))
    for seed in range(10):
        episode(env, seed, 1)
    gc.collect()
    tracemalloc.start()
    for seed in range(50):
        episode(env, seed, 1)
    gc.collect()
    grown, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    print(f"{grown} bytes")
    assert grown < 5e6 * 50 / 200


def test_by_default_every_link_sounds(opened: Any) -> None:
    """A sheet without thickness cannot be filled: it is named once and stays silent."""
    bare = opened(FallingBox())
    sheet = bare.physics.createCollisionShape(
        p.GEOM_MESH,
        vertices=[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        indices=[0, 1, 2, 0, 2, 3],
        flags=p.GEOM_FORCE_CONCAVE_TRIMESH,
    )
    bare.physics.createMultiBody(0, sheet, basePosition=[5, 5, 0])
    env = opened(SoundObservation(bare, materials="wood"))
    with pytest.warns(SceneWarning, match=r"left silent: body 2 is a triangle mesh"):
        env.reset(seed=0)
    materials = {body.body_id: body.material for body in env.listener.world.bodies}
    assert set(materials) == {0, 1} and {material.name for material in materials.values()} == {"wood"}
    with warnings.catch_warnings():
        warnings.simplefilter("error", SceneWarning)
        assert episode(env, 0)[0].any()


def test_gymnasium_is_an_extra() -> None:
    code = (
        "import sys; sys.modules['gymnasium'] = None\nimport sonic_bullet\n"
        "from sonic_bullet.apps.environments import log_mel\n"
        "try:\n    from sonic_bullet.apps.environments import SoundObservation\n"
        "except sonic_bullet.SonicBulletError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120)
    assert done.stdout == 'gymnasium is not installed; pip install "sonic_bullet[environments]"\n'


def test_an_episode_is_recorded_as_its_chain_says(opened: Any) -> None:
    """The plain episode through the chain of its seed, whose numbers are in info; another seed has another chain."""
    spread = ChainSpread(gain_db=(-6, 6), response_db=3.0, noise_rthz=(1e-6, 1e-5), latency_s=(0.0, 0.01))
    how: dict[str, Any] = {"microphones": MICROPHONES, "materials": plates, "seed": 4}
    plain, _ = episode(opened(SoundObservation(FallingBox(), **how)), 3)
    env = opened(SoundObservation(FallingBox(), **how, recording=spread))
    heard, _ = episode(env, 3)
    _, info = env.reset(seed=3)
    chain = draw_chain(np.random.default_rng([4, 1, 3]), spread)
    assert info["recording"] == chain.to_json()
    law, _ = record(plain.astype(float), 48_000, chain)
    assert np.abs(heard - law).max() < 1e-5 * np.abs(law).max()
    assert np.array_equal(heard, episode(env, 3)[0])
    assert env.reset(seed=5)[1]["recording"] != info["recording"]
    with pytest.raises(RecordError, match="recording"):
        SoundObservation(FallingBox(), recording=5)


class TappedArm(gymnasium.Env[Any, Any]):  # type: ignore[misc]
    """A ball taps an arm of two links."""

    observation_space = gymnasium.spaces.Discrete(1)
    action_space = gymnasium.spaces.Discrete(1)

    def __init__(self) -> None:
        self.physics: Any = direct_client()

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        self.physics.resetSimulation()
        self.arm, self.ball = tap_arm(self.physics)
        return 0, {}

    def step(self, action: Any) -> tuple[int, float, bool, bool, dict[str, Any]]:
        for _ in range(12):
            self.physics.stepSimulation()
        return 0, 0.0, False, False, {}

    def close(self) -> None:
        disconnect(self.physics)


def arm_materials(_: Any) -> dict[Any, Any]:
    return {
        **{(0, link): how for link, how in arm_cast().items()},
        1: {"material": STEEL, "model": ball_body(0.01).model},
    }


def test_two_contact_microphones_are_averaged_and_joints_vary(opened: Any) -> None:
    """The mean of both channels; springs of joints are heard, and their drawn factor is in info."""
    touching = [sb.ContactMicrophone(0, (x, 0.01, 0), (0, 1, 0), 1) for x in (0.02, 0.08)]
    how: dict[str, Any] = {"microphones": touching, "materials": arm_materials}
    springs = {0: {"all": (2e4, 0.05)}}

    def heard(**more: Any) -> tuple[Any, Any]:
        env = opened(SoundObservation(TappedArm(), **how, **more))
        _, info = env.reset(seed=3)
        return env.step(0)[0]["audio"], info.get("recording")

    both, _ = heard()
    mean, _ = heard(average=True)
    assert mean.shape == (1, both.shape[1]) and np.abs(both).max() > 0
    assert np.allclose(mean[0], both.mean(axis=0), atol=1e-6 * np.abs(both).max())
    held, _ = heard(joints=springs)
    varied, chain = heard(joints=springs, recording=ChainSpread(joint_factor=(2.0, 4.0)))
    assert 2 <= chain["joint_factor"] <= 4
    same, _ = heard(joints={0: {"all": (2e4 * chain["joint_factor"], 0.05)}})
    assert not np.array_equal(held, both) and not np.array_equal(varied, held)
    assert np.allclose(varied, same, atol=1e-5 * np.abs(same).max())


@pytest.mark.parametrize("joints", [5, {0: {"all": 3.0}}, {0: {"all": (-1.0, 0.1)}}, {0: {"elbow": (1.0, 0.1)}}])
def test_springs_of_joints_are_checked(opened: Any, joints: Any) -> None:
    with pytest.raises((RecordError, SceneError), match=r"joint|elbow"):
        opened(SoundObservation(TappedArm(), materials=arm_materials, joints=joints)).reset()
