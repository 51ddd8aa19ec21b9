"""What users do wrong, and what worlds do under way: one clear line, or sound that goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest
from made_models import STEEL, WOOD, ball_body, box_model
from made_worlds import ball, box, floor, plate_model, sounding_box

import sonic_bullet as sb
from sonic_bullet.errors import AudioError, FileError, LogError, MaterialError, RecordError, SceneError, SonicBulletError
from sonic_bullet.listener import direct_client, disconnect


def steps(client: Any, count: int) -> None:
    for _ in range(count):
        client.stepSimulation()


def one_line(error: pytest.ExceptionInfo[SonicBulletError]) -> None:
    assert "\n" not in str(error.value)
    assert error.value.remedy


# --- refused, with one line


@pytest.mark.parametrize("sr", [0, -48_000, 10**9, float("nan"), float("inf"), 44_100.5, "fast"])
def test_sample_rates_that_cannot_be(client: Any, sr: Any) -> None:
    with pytest.raises(AudioError) as error:
        sb.attach(client, sr=sr)
    one_line(error)


@pytest.mark.parametrize("place", [(0, float("nan"), 0), (0, 0), [(0, 0, 0), (0, float("inf"), 1)], "here", None, [(0, 0, 1), (2,)]])
def test_microphones_that_are_no_points(client: Any, place: Any) -> None:
    with pytest.raises(RecordError) as error:
        sb.attach(client, microphone=place)
    one_line(error)


@pytest.mark.parametrize("what", [None, object(), 99, "client"])
def test_clients_that_are_none(what: Any) -> None:
    with pytest.raises(SceneError) as error:
        sb.attach(what)
    one_line(error)


def test_materials_that_are_unknown_or_never_stop_ringing(client: Any) -> None:
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    with pytest.raises(MaterialError, match="unobtainium") as error:
        listener.add(body, material="unobtainium", model=plate_model())
    one_line(error)
    with pytest.raises(MaterialError, match="no damping") as error:
        listener.add(body, material=sb.Material.isotropic("ideal", youngs_pa=1e9, poisson=0.3, density_kg_m3=1000), model=plate_model())
    one_line(error)


@pytest.mark.parametrize("mass", [float("nan"), -1.0, 1e300])
def test_masses_that_are_none(client: Any, mass: float) -> None:
    body = box(client, (0, 0, 1))
    client.changeDynamics(body, -1, mass=mass)
    listener = sb.attach(client)
    known = client.getDynamicsInfo(body, -1)[0]
    if known == mass or not np.isfinite(known):
        with pytest.raises(SonicBulletError, match=str(body)) as error:
            listener.add(body, material=STEEL, model=plate_model())
            steps(client, 3)
        one_line(error)


def test_bodies_that_are_gone_or_never_were(client: Any) -> None:
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    client.removeBody(body)
    for who in (body, 77):
        with pytest.raises(SceneError, match=str(who)) as error:
            listener.add(who, material=STEEL, model=plate_model())
        one_line(error)
    with pytest.raises(SceneError) as error:
        listener.add(box(client, (0, 0, 1)), 3, material=STEEL, model=plate_model())
    one_line(error)
    with pytest.raises(LogError) as error:
        listener.contacts.impulse_on(77)
    one_line(error)


def test_a_lost_connection_is_named_and_the_sound_so_far_stays(tmp_path: Path) -> None:
    raw = p.connect(p.DIRECT)
    from pybullet_utils.bullet_client import BulletClient

    client = BulletClient(p.DIRECT)
    client.setGravity(0, 0, -9.81)
    floor(client)
    listener = sb.attach(client)
    sounding_box(client, listener, (0, 0, 0.1))
    steps(client, 60)
    p.disconnect(client._client)
    p.disconnect(raw)
    with pytest.raises(SceneError) as error:
        client.stepSimulation()
    disconnect(client)  # or its finaliser ends whoever has its id next
    one_line(error)
    listener.write(tmp_path / "so_far.wav")
    assert np.abs(sb.read_audio(str(tmp_path / "so_far.wav"))[0]).max() > 0.01
    listener.detach()


def test_a_path_that_cannot_be_written(client: Any, tmp_path: Path) -> None:
    listener = sb.attach(client)
    steps(client, 3)
    with pytest.raises(FileError) as error:
        listener.write(tmp_path / "no" / "folder" / "a.wav")
    one_line(error)
    with pytest.raises(FileError) as error:
        listener.contacts.save(tmp_path / "no" / "folder" / "a.npz")
    one_line(error)
    assert not list(tmp_path.iterdir())


# --- worlds that change under way


def test_a_body_removed_while_it_rings_rings_on(client: Any) -> None:
    floor(client)
    listener = sb.attach(client, microphone=(0, 0, 1))
    body = sounding_box(client, listener, (0, 0, 0.06))
    steps(client, 60)
    client.removeBody(body)
    before = np.abs(listener.sound()[0, -2000:]).max()
    steps(client, 60)
    tail = listener.sound()[0, -12_000:]
    assert before > 1e-4
    assert np.abs(tail[2000:4000]).max() > 0.05 * before
    assert np.abs(tail[-2000:]).max() < before


def test_a_reset_world_goes_on_with_new_bodies_of_old_ids(client: Any) -> None:
    floor(client)
    listener = sb.attach(client, microphone=(0, 0, 1))
    old = sounding_box(client, listener, (0, 0, 0.06))
    steps(client, 60)
    client.resetSimulation()
    client.setGravity(0, 0, -9.81)
    floor(client)
    listener.quench()
    new = sounding_box(client, listener, (0, 0, 0.06))
    assert new == old
    n = listener.sound().shape[1]
    steps(client, 60)
    log = listener.contacts
    assert [body.body_id for body in log.bodies].count(old) == 2
    assert log.bodies[0].until_step == 60
    sound = listener.sound()
    assert sound.shape[1] == 2 * n
    assert np.abs(sound[0, n:]).max() > 0.1 * np.abs(sound[0, :n]).max()
    np.testing.assert_array_equal(sb.render_log(log)[0, -200:].shape, (200,))


def test_a_body_added_after_steps_have_run_sounds_from_then_on(client: Any) -> None:
    floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = box(client, (0, 0, 0.06))
    steps(client, 60)
    assert not listener.sound().any()
    listener.add(body, material=STEEL, model=plate_model())
    client.resetBaseVelocity(body, [0, 0, 1])
    steps(client, 90)
    sound = listener.sound()[0]
    assert not sound[: 60 * 200 - 200].any()
    assert np.abs(sound[60 * 200 :]).max() > 1e-3


def test_a_body_added_twice_takes_its_new_material(client: Any) -> None:
    floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = box(client, (0, 0, 0.06))
    listener.add(body, material=STEEL, model=plate_model())
    listener.add(body, material=WOOD, model=box_model((0.2, 0.1, 0.01), (500.0,), WOOD))
    steps(client, 90)
    spectrum = np.abs(np.fft.rfft(listener.sound()[0]))
    freq = np.fft.rfftfreq(listener.sound().shape[1], 1 / 48_000)
    assert freq[np.argmax(spectrum * (freq > 100))] == pytest.approx(500, rel=0.03)
    assert np.isclose(len(listener.contacts.impulse_on(body)), sum(len(s.contacts) for s in listener.contacts.steps))


def test_the_time_step_may_change_under_way(client: Any) -> None:
    from fractions import Fraction
    from math import floor as whole

    floor(client)
    listener = sb.attach(client, sr=44_100)
    sounding_box(client, listener)
    total, time = 0, Fraction(0)
    for dt, count in ((Fraction(1, 240), 40), (Fraction(1, 1000), 100), (Fraction(1, 60), 10), (Fraction(1, 240), 40)):
        client.setTimeStep(float(dt))
        for _ in range(count):
            client.stepSimulation()
            time += dt
            total += listener.frame.shape[1]
            assert total == whole(time * 44_100)
    assert listener.sound().shape[1] == total
    np.testing.assert_array_equal(listener.sound(), sb.render_log(listener.contacts))


def test_substeps_are_heard(client: Any) -> None:
    """Four sub-steps: the same fall is as loud within 6 dB."""
    levels = []
    for substeps in (1, 4):
        world = direct_client()
        world.setGravity(0, 0, -9.81)
        world.setPhysicsEngineParameter(numSubSteps=substeps)
        floor(world)
        listener = sb.attach(world, microphone=sb.ModalSum())
        body = box(world, (0, 0, 0.15), turn=(0, 0, 0))
        listener.add(body, material=STEEL, model=plate_model())
        steps(world, 60)
        levels.append(np.abs(listener.sound()).max())
        listener.detach()
        disconnect(world)
    assert 0.5 < levels[1] / levels[0] < 2


def test_static_bodies_sound(client: Any) -> None:
    ground = floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    listener.add(ground, material=WOOD, model=box_model((1, 1, 0.1), (200.0, 410.0), WOOD))
    falling = ball(client, (0.1, 0.2, 0.1))
    listener.add(falling, material=STEEL, model=ball_body(0.02).model)
    steps(client, 90)
    assert np.abs(listener.sound()).max() > 1e-4


# --- silence


def test_a_resting_body_is_silent_polled_teleported_or_asleep(client: Any) -> None:
    ground = floor(client)
    listener = sb.attach(client, microphone=[sb.Microphone([0, 0, 1]), sb.ModalSum()])
    body = box(client, (0, 0, 0.03), turn=(0, 0, 0))
    listener.add(body, material=STEEL, model=plate_model())
    steps(client, 240)
    loudest = np.abs(listener.sound()).max(axis=1)
    listener.quench()
    start = listener.sound().shape[1]
    steps(client, 60)
    listener.step()
    listener.step()
    client.resetBasePositionAndOrientation(body, [0.3, 0.1, 0.005], [0, 0, 0, 1])
    steps(client, 60)
    client.changeDynamics(body, -1, activationState=p.ACTIVATION_STATE_SLEEP)
    client.changeDynamics(ground, -1, activationState=p.ACTIVATION_STATE_SLEEP)
    steps(client, 60)
    after = np.abs(listener.sound()[:, start:]).max(axis=1)
    print(f"landing {loudest}, after {after}")
    assert (loudest > 0).all()
    assert (after <= 1e-5 * loudest).all()


def test_zero_gravity_slow_impacts_sound(client: Any) -> None:
    """1 mm/s in space: no gravity, no allowance for resting; it clicks and rings."""
    client.setGravity(0, 0, 0)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = box(client, (0, 0, 0), turn=(0, 0, 0))
    listener.add(body, material=STEEL, model=plate_model())
    other = ball(client, (0.05, 0.02, 0.0255))
    client.resetBaseVelocity(other, [0, 0, -1e-3])
    steps(client, 200)
    assert len(listener.contacts) > 0
    assert np.abs(listener.sound()).max() > 1e-7


# --- numbers


def test_no_frame_or_file_holds_nan_inf_or_subnormals(client: Any, tmp_path: Path) -> None:
    """A short-lived ring dies away for 4 s: its tail ends in zeros, in frames and in the float32 file."""
    floor(client, restitution=0.0)
    listener = sb.attach(client, microphone=[sb.Microphone([0, 0, 1]), sb.ModalSum()])
    body = box(client, (0, 0, 0.03), turn=(0, 0, 0))
    dull = sb.Material.isotropic("dull", youngs_pa=1e9, poisson=0.3, density_kg_m3=900, alpha_per_s=120.0, beta_s=1e-7)
    listener.add(body, material=dull, model=box_model((0.2, 0.1, 0.01), (300.0, 900.0), dull))
    client.setTimeStep(1 / 60)
    frames = []
    for _ in range(240):
        client.stepSimulation()
        frames.append(listener.frame)
    listener.write(tmp_path / "tail.wav")
    for samples, least in ((np.concatenate(frames, axis=1), np.finfo(float).tiny), (sb.read_audio(str(tmp_path / "tail.wav"))[0], np.finfo(np.float32).tiny)):
        assert np.isfinite(samples).all()
        size = np.abs(samples[samples != 0])
        assert size.min() >= least
        assert size.max() > 1e-3
        assert not samples[:, -4800:].any()


def test_a_body_put_down_at_rest_is_silent_and_a_silent_hammer_is_heard(client: Any) -> None:
    """Bullet finds the corners of a box one a step and lets it tilt: that is no blow. A partner without material strikes as any other."""
    floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = box(client, (0, 0, 0.005), turn=(0, 0, 0))
    listener.add(body, material=STEEL, model=plate_model())
    steps(client, 60)
    client.resetBasePositionAndOrientation(body, [0.3, 0.1, 0.005], [0, 0, 0, 1])
    steps(client, 60)
    assert not listener.sound().any()
    hammer = ball(client, (0.35, 0.12, 0.04))
    client.resetBaseVelocity(hammer, [0, 0, -0.1])
    steps(client, 60)
    assert np.abs(listener.sound()).max() > 1e-3
    at = listener.contacts.rows_on(hammer)
    assert listener.contacts.rows.approach_m_s[at[0]] < 0.7


@pytest.mark.parametrize("seed", ["x", -1, 1.5, None])
def test_seeds_that_are_none(client: Any, seed: Any) -> None:
    with pytest.raises(RecordError) as error:
        sb.attach(client, seed=seed)
    one_line(error)


def test_adding_tells_which_body_is_analysed_and_an_unknown_body_before_any_work(client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from sonic_bullet import modal

    def analyse(shapes: Any, material: Any, *, progress: Any, **_: Any) -> Any:
        progress("assembling")
        return plate_model()

    monkeypatch.setattr(modal, "analyse", analyse)
    body = box(client, (0, 0, 1))
    listener = sb.attach(client)
    told: list[str] = []
    listener.add(body, material=STEEL, progress=told.append)
    name = listener.world.name_of(body)
    assert told == [f"modes of {name}: assembling", f"how 4 modes of {name} radiate"]
    assert f"body {body}" in told[0]
    monkeypatch.setattr(modal, "analyse", lambda *_, **__: pytest.fail("analysed for nobody"))
    with pytest.raises(SceneError, match="no body 99"):
        listener.add(99, material=STEEL, mesh=listener.world.shapes_of(body))


def test_a_script_with_its_own_listener_that_breaks_keeps_what_was_heard(tmp_path: Path) -> None:
    from sonic_bullet.scene import render_scene

    scene = tmp_path / "own.py"
    scene.write_text(
        "import pybullet as p, sonic_bullet as sb\n"
        "from pybullet_utils.bullet_client import BulletClient\n"
        "client = BulletClient(p.DIRECT)\n"
        "listener = sb.attach(client)\n"
        "for _ in range(24):\n"
        "    client.stepSimulation()\n"
        "raise ValueError('x')\n"
    )
    shares: list[float] = []
    with pytest.raises(SceneError, match="line 7: ValueError: x") as error:
        render_scene(scene, seconds=1, progress=shares.append)
    assert error.value.partial.samples.shape == (1, 4800)  # type: ignore[attr-defined]
    assert shares[-1] == pytest.approx(0.1)


@pytest.mark.parametrize("cast", ['{0: {"material": "steel", "nonsense": 3}}', "{0: 3.0}", '{"x": "steel"}', '{(0, 1, 2): "steel"}'])
def test_casts_that_make_no_sense_are_one_line(tmp_path: Path, cast: str) -> None:
    from sonic_bullet.scene import render_scene

    scene = tmp_path / "cast.py"
    scene.write_text(f"def build(client):\n    client.createMultiBody(1, client.createCollisionShape(client.GEOM_SPHERE, radius=0.01))\n    return {cast}\n")
    with pytest.raises(SonicBulletError) as error:
        render_scene(scene, seconds=0.1)
    one_line(error)


def test_a_body_that_has_touched_nothing_has_no_impulses(client: Any) -> None:
    body = box(client, (0, 0, 5))
    listener = sb.attach(client)
    steps(client, 3)
    assert listener.contacts.impulse_on(body).shape == (0, 3)
    assert listener.contacts.rows_on(body).shape == (0,)
    with pytest.raises(LogError, match="no body 7"):
        listener.contacts.impulse_on(7)
