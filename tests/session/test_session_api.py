"""What a user does: attach, add, step, listen, write, detach."""

from __future__ import annotations

import subprocess
import sys
from math import floor as whole
from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest
from pybullet_utils.bullet_client import BulletClient

import sonic_bullet as sb
from sonic_bullet.engine.runtime.clock import exact_step
from sonic_bullet.records.errors import SceneError
from tests.made.models import STEEL
from tests.made.worlds import floor, plate_model, sounding_box


def observed(client: Any, steps: int, **how: Any) -> tuple[Any, list[np.ndarray]]:
    """A box falls on the floor; the listener and all its frames."""
    floor(client)
    listener = sb.attach(client, **how)
    sounding_box(client, listener)
    frames = []
    for _ in range(steps):
        client.stepSimulation()
        frames.append(listener.frame)
    return listener, frames


@pytest.mark.parametrize("sr", [48_000, 44_100])
@pytest.mark.parametrize("dt", [1 / 240, 1 / 1000, 1 / 60])
def test_frames_fill_time_exactly_and_lag_by_a_constant(client: Any, sr: int, dt: float) -> None:
    client.setTimeStep(dt)
    listener, frames = observed(client, round(0.5 / dt), sr=sr, microphone=[(0, -1, 0.5), (1, 0, 0.5)])
    lengths = np.cumsum([frame.shape[1] for frame in frames])
    exact = [whole((k + 1) * exact_step(dt) * sr) for k in range(len(frames))]
    assert lengths.tolist() == exact
    assert {frame.shape[0] for frame in frames} == {2}
    assert {frame.dtype for frame in frames} == {np.dtype(float)}
    sound, live = listener.sound(), np.concatenate(frames, axis=1)
    assert sound.shape == live.shape == (2, exact[-1])
    lag = 3 * exact_step(dt) * sr
    samples = int(lag) if lag.denominator == 1 else whole(lag) + 1  # a step of no whole number of samples: the next one
    assert np.abs(sound).max() > 0.01
    assert not live[:, :samples].any()
    np.testing.assert_array_equal(live[:, samples:], sound[:, :-samples])
    assert sb.Listener.latency_steps == listener.latency_steps == 3


def test_a_step_before_it_sounds_is_not_lost_in_the_lag(client: Any) -> None:
    """The lag is latency_steps and not more: as soon as that many steps follow a strike, its frame holds it."""
    client.setGravity(0, 0, 0)
    floor(client)
    listener = sb.attach(client, microphone=(0, 0, 0.1))
    body = sounding_box(client, listener, (0, 0, 0.006), turn=(0, 0, 0))
    client.resetBaseVelocity(body, [0, 0, -1])
    frames = []
    for _ in range(12):
        client.stepSimulation()
        frames.append(listener.frame)
    first = next(i for i, step in enumerate(listener.contacts.steps) if len(step.contacts))
    loud = next(i for i, frame in enumerate(frames) if frame.any())
    assert first + 2 <= loud <= first + 3  # a strike may be dated back into the step before


def test_read_gathers_what_frames_gave(client: Any) -> None:
    listener, frames = observed(client, 50)
    np.testing.assert_array_equal(listener.read(), np.concatenate(frames, axis=1))
    assert listener.read().shape == (1, 0)
    client.stepSimulation()
    np.testing.assert_array_equal(listener.read(), listener.frame)


def test_write_removes_the_lag_and_keeps_pascals(client: Any, tmp_path: Path) -> None:
    listener, _ = observed(client, 120, microphone=[(0, -1, 0.5), (0, 1, 0.5)])
    listener.write(tmp_path / "a.wav")
    samples, sr = sb.read_audio(str(tmp_path / "a.wav"))
    assert sr == 48_000
    np.testing.assert_array_equal(samples, listener.sound().astype(np.float32))
    assert np.abs(samples).max() > 0.01
    assert list(tmp_path.iterdir()) == [tmp_path / "a.wav"]


def test_a_client_id_and_the_hook_hear_the_same(client: Any) -> None:
    """Without a hook the pose before the step is computed back from velocities, to rounding: so is the sound."""
    hooked, _ = observed(client, 60)
    raw = BulletClient(p.DIRECT)
    raw.setGravity(0, 0, -9.81)
    floor(raw)
    listener = sb.attach(raw._client)
    sounding_box(raw, listener)
    assert "stepSimulation" not in vars(raw)
    for _ in range(60):
        raw.stepSimulation()
        assert listener.step() is listener.frame
    error = np.abs(listener.sound() - hooked.sound()).max() / np.abs(hooked.sound()).max()
    print(f"client id against hook: {error:.1e} of the peak")
    assert error < 1e-6
    listener.detach()


@pytest.mark.slow
def test_the_raw_module_is_stepped_by_hand() -> None:
    """In a process of its own: the module's default client is number 0."""
    script = """
import pybullet as p, numpy as np, sonic_bullet as sb, sys
sys.path[:0] = sys.argv[1:]
from tests.made.models import STEEL, box_model
assert p.connect(p.DIRECT) == 0
p.setGravity(0, 0, -9.81)
p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
listener = sb.attach(p)
box = p.createMultiBody(0.4, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.05, 0.005]), \
basePosition=[0, 0, 0.1])
listener.add(box, material=STEEL, model=box_model((0.2, 0.1, 0.01), (740.0, 1230.0)))
n = 0
for _ in range(60):
    p.stepSimulation()
    n += listener.step().shape[1]
assert n == 12000 == listener.sound().shape[1], n
assert np.abs(listener.sound()).max() > 0.01
listener.detach()
"""
    here = Path(__file__).parent
    subprocess.run([sys.executable, "-c", script, str(here), str(here.parent / "render")], check=True, timeout=120)


def test_detach_leaves_the_client_as_it_was(client: Any) -> None:
    before = set(vars(client))
    listener, _ = observed(client, 30)
    assert "stepSimulation" in vars(client)
    listener.detach()
    listener.detach()
    assert set(vars(client)) == before
    sound = listener.sound()
    client.stepSimulation()
    assert listener.sound().shape == sound.shape == (1, 6000)
    assert len(listener.contacts.steps) == 30
    with pytest.raises(SceneError, match="detached"):
        listener.step()


def test_leaving_the_context_detaches_even_on_an_error(client: Any) -> None:
    with pytest.raises(KeyError), sb.attach(client) as listener:
        client.stepSimulation()
        raise KeyError
    assert "stepSimulation" not in vars(client)
    assert listener.time_s == pytest.approx(1 / 240)


def test_a_second_poll_of_one_step_gives_no_samples(client: Any) -> None:
    listener, _ = observed(client, 60)
    n = listener.sound().shape[1]
    assert listener.step().shape == (1, 0)
    assert listener.sound().shape[1] == n
    assert len(listener.contacts.steps) == 60


def test_all_arguments_but_the_client_have_defaults(client: Any) -> None:
    listener = sb.attach(client)
    assert (listener.sr, listener.seed, len(listener.sensors)) == (48_000, 0, 1)
    np.testing.assert_array_equal(listener.sensors[0].position_m, [0, -1, 0.5])


def test_links_sound_too(client: Any) -> None:
    """A two-link body with the sounding shape on its link."""
    floor(client)
    shape = client.createCollisionShape(p.GEOM_BOX, halfExtents=[0.1, 0.05, 0.005])
    body = client.createMultiBody(
        0.1,
        -1,
        basePosition=[0, 0, 0.2],
        linkMasses=[0.4],
        linkCollisionShapeIndices=[shape],
        linkVisualShapeIndices=[-1],
        linkPositions=[[0, 0, -0.05]],
        linkOrientations=[[0, 0, 0, 1]],
        linkInertialFramePositions=[[0, 0, 0]],
        linkInertialFrameOrientations=[[0, 0, 0, 1]],
        linkParentIndices=[0],
        linkJointTypes=[p.JOINT_FIXED],
        linkJointAxis=[[0, 0, 1]],
    )
    listener = sb.attach(client)
    listener.add(body, 0, material=STEEL, model=plate_model())
    for _ in range(80):
        client.stepSimulation()
    assert np.abs(listener.sound()).max() > 0.01
    assert len(listener.contacts.impulse_on(body, 0)) > 0


def test_gym_environments_that_hide_their_steps_are_heard() -> None:
    gym = pytest.importorskip("gymnasium")
    pytest.importorskip("panda_gym")
    environment = gym.make("PandaPush-v3")
    try:
        client = environment.unwrapped.sim.physics_client
        environment.reset(seed=0)
        listener = sb.attach(client)
        body = environment.unwrapped.sim._bodies_idx["object"]
        listener.add(body, material=STEEL, model=plate_model())
        before = len(listener.contacts.steps)
        dt = client.getPhysicsEngineParameters()["fixedTimeStep"]
        for _ in range(5):
            environment.step(np.array([0.0, 0.0, -1.0]))
        hidden = len(listener.contacts.steps) - before
        assert hidden == 5 * environment.unwrapped.sim.n_substeps == 100
        assert listener.read().shape[1] == whole(hidden * exact_step(dt) * 48_000)
        listener.detach()
    finally:
        environment.close()


def test_how_the_sound_is_read_out_does_not_matter(client: Any) -> None:
    """Looking at `sound`, `contacts` and `read` under way, in any rhythm, leaves every bit as it is."""
    quiet, frames = observed(client, 90)
    other = BulletClient(p.DIRECT)
    other.setGravity(0, 0, -9.81)
    floor(other)
    listener = sb.attach(other)
    sounding_box(other, listener)
    rng = np.random.default_rng(0)
    pieces = []
    for number in range(90):
        other.stepSimulation()
        if rng.random() < 0.4:
            pieces.append(listener.read())
        if number % 13 == 0:
            np.testing.assert_array_equal(
                listener.sound()[:, : max(number - 2, 0) * 200], quiet.sound()[:, : max(number - 2, 0) * 200]
            )
            assert len(listener.contacts.steps) == number + 1
    pieces.append(listener.read())
    np.testing.assert_array_equal(np.concatenate(pieces, axis=1), np.concatenate(frames, axis=1))
    np.testing.assert_array_equal(listener.sound(), quiet.sound())
    listener.detach()


def test_without_a_microphone_contacts_are_kept_and_nothing_is_computed(
    client: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sonic_bullet.radiation import far_field as radiation

    monkeypatch.setattr(radiation, "radiation", lambda *_: pytest.fail("nobody hears it"))
    floor(client)
    listener = sb.attach(client, microphone=())
    sounding_box(client, listener, (0, 0, 0.06))
    for _ in range(30):
        client.stepSimulation()
        assert listener.frame.shape == (0, 200)
    assert len(listener.contacts) > 0
    assert listener.sound().shape == (0, 6000)
