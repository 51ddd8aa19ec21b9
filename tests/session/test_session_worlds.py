"""Worlds that change under way: sound goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pybullet as p
import pytest

import sonic_bullet as sb
from sonic_bullet.simulators import direct_client, disconnect
from tests.made.models import STEEL, WOOD, ball_body, box_model
from tests.made.worlds import ball, box, floor, plate_model, sounding_box
from tests.session.test_session_robust import steps


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
    for samples, least in (
        (np.concatenate(frames, axis=1), np.finfo(float).tiny),
        (sb.read_audio(str(tmp_path / "tail.wav"))[0], np.finfo(np.float32).tiny),
    ):
        assert np.isfinite(samples).all()
        size = np.abs(samples[samples != 0])
        assert size.min() >= least
        assert size.max() > 1e-3
        assert not samples[:, -4800:].any()


def test_a_body_put_down_at_rest_is_silent_and_a_silent_hammer_is_heard(client: Any) -> None:
    """Bullet finds the corners of a box one a step and lets it tilt: that is no blow.

    A partner without material strikes as any other. What creeps at rest over a floor as rough as any stays far below.
    """
    floor(client)
    listener = sb.attach(client, microphone=sb.ModalSum())
    body = box(client, (0, 0, 0.005), turn=(0, 0, 0))
    listener.add(body, material=STEEL, model=plate_model())
    steps(client, 60)
    client.resetBasePositionAndOrientation(body, [0.3, 0.1, 0.005], [0, 0, 0, 1])
    steps(client, 60)
    assert np.abs(listener.sound()).max() < 1e-6
    hammer = ball(client, (0.35, 0.12, 0.04))
    client.resetBaseVelocity(hammer, [0, 0, -0.1])
    steps(client, 60)
    assert np.abs(listener.sound()).max() > 1e-3
    at = listener.contacts.rows_on(hammer)
    assert listener.contacts.rows.approach_m_s[at[0]] < 0.7
