"""Sub-steps are heard as steps: two touches within a step are two events, at their places and times."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import sonic_bullet as sb
from sonic_bullet.scene import render_scene
from sonic_bullet.signal.octave_bands import AUDIBLE_OCTAVES_HZ, octave_power
from tests.made.models import STEEL
from tests.made.worlds import box, floor, plate_model


@pytest.mark.shared
def test_substeps_give_the_events_and_the_sound_of_steps(shared_path: Path) -> None:
    """1/500 s and 1/50 s of ten sub-steps: the same motion."""
    folder = shared_path / "faults" / "09-two-touches-in-a-step"
    one, other = (render_scene(folder / f"{name}.py") for name in ("single", "substeps"))
    a, b = one.log, other.log
    assert len(a.steps) == len(b.steps) == 250
    assert a.step.tolist() == b.step.tolist()
    assert b.steps[0].dt_s == pytest.approx(1 / 500)
    hits = np.linalg.norm(a.rows.impulse_n_s, axis=1) > 0.005
    assert hits.sum() == 6
    for name in ("point_a_m", "point_b_m"):
        np.testing.assert_allclose(getattr(b.rows, name)[hits], getattr(a.rows, name)[hits], atol=2e-3)
    sizes = [np.linalg.norm(log.rows.impulse_n_s[hits], axis=1) for log in (a, b)]
    np.testing.assert_allclose(sizes[1], sizes[0], rtol=0.05)
    np.testing.assert_allclose(b.rows.approach_m_s[hits], a.rows.approach_m_s[hits], atol=1e-3)
    power = [
        np.array(octave_power(np.abs(np.fft.rfft(x)) ** 2, np.fft.rfftfreq(len(x), 1 / 48_000), AUDIBLE_OCTAVES_HZ))
        for x in (one.samples[0], other.samples[0])
    ]
    assert np.abs(10 * np.log10(power[1] / power[0])).max() < 1
    np.testing.assert_array_equal(sb.render_log(b), other.samples)


def test_frames_of_steps_with_substeps_are_as_long_as_the_steps(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(numSubSteps=5)
    listener = sb.attach(client, microphone=(0, -1, 0.5), sr=24_000)
    floor(client)
    listener.add(box(client, (0, 0, 0.05)), material=STEEL, model=plate_model())
    frames = []
    for number in range(48):
        client.stepSimulation()
        assert listener.frame.shape == (1, 100)
        frames.append(listener.frame)
        if number == 20:  # bodies that come and go between steps
            box(client, (1, 1, 0.05))
    sound = listener.sound()
    assert sound.shape == (1, 4800) and np.abs(sound).max() > 0
    lag = 3 * 20  # of three sub-steps
    joined = np.concatenate(frames, axis=1)
    np.testing.assert_array_equal(joined[:, lag:], sound[:, : joined.shape[1] - lag])
    assert len(listener.contacts.steps) == 48 * 5
    np.testing.assert_array_equal(sb.render_log(listener.contacts), sound)


def test_momentum_balances_over_substeps_with_friction(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(numSubSteps=8)
    listener = sb.attach(client, microphone=())
    floor(client)
    plate = box(client, (0, 0, 0.1))
    client.resetBaseVelocity(plate, [1.0, 0.3, 0])
    listener.add(plate, material=STEEL, model=plate_model())
    for number in range(60):
        before = np.array(client.getBaseVelocity(plate)[0])
        rows = 0 if not number else len(listener.contacts)
        client.stepSimulation()
        given = listener.contacts.rows.impulse_n_s[rows:].sum(axis=0)
        if not len(listener.contacts.rows.impulse_n_s[rows:]):
            continue
        sign = 1 if listener.contacts.bodies[listener.contacts.rows.a[rows]].body_id == plate else -1
        change = 0.4 * (np.array(client.getBaseVelocity(plate)[0]) - before + [0, 0, 9.81 / 240])
        np.testing.assert_allclose(sign * given, change, atol=0.02 * np.linalg.norm(change) + 2e-4)


def test_steps_that_are_not_hooked_say_once_that_touches_within_them_are_one(client: Any) -> None:
    client.setGravity(0, 0, -9.81)
    client.setPhysicsEngineParameter(numSubSteps=5)
    floor(client)
    plate = box(client, (0, 0, 0.02))
    listener = sb.attach(client._client, microphone=())
    listener.add(plate, material=STEEL, model=plate_model())
    with pytest.warns(sb.records.errors.SceneWarning, match="numSubSteps is 5") as seen:
        for _ in range(20):
            client.stepSimulation()
            listener.step()
    assert len(seen) == 1
    assert len(listener.contacts.steps) == 20
