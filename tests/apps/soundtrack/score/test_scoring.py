"""From poses to a sound: what is stopped is kept, what is deep or noisy is said, equal poses give equal bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.export import assemble_animation
from sonic_bullet.apps.soundtrack.score.scoring import score_animation
from sonic_bullet.engine.runtime.sound_events import find_sound_events
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.machine.progress import progress_to
from tests.few_cases import parametrize_few
from tests.made.animations import MASS_KG, RADIUS_M, ball_animation, bounce_m, dropped, export_of


@pytest.fixture(scope="module")
def animation() -> Animation:
    return assemble_animation(export_of(dropped(60)), (), "wood")[0]


def test_what_is_stopped_is_kept_as_far_as_it_was_found(animation: Animation) -> None:
    stops = iter([True])

    def stop(share: float) -> None:
        if share > 0.35 and next(stops, False):
            raise KeyboardInterrupt

    whole = score_animation(animation, sr=8000)
    with pytest.raises(KeyboardInterrupt) as caught, progress_to(fraction=stop):
        score_animation(animation, sr=8000)
    part = caught.value.partial  # type: ignore[attr-defined]
    assert 0.2 < part.log.duration_s < 0.5 * whole.log.duration_s + 0.05
    sound = part.sound.samples()
    assert np.array_equal(sound[:, :1200], whole.sound.samples()[:, :1200])  # 0.15 s, before what was found last


def test_equal_poses_sound_equal(animation: Animation) -> None:
    one, other = (score_animation(animation, sr=8000).sound.samples() for _ in range(2))
    assert np.array_equal(one, other) and np.abs(one).max() > 0


def test_bodies_that_overlap_are_said_and_not_thrown() -> None:
    """A ball that sinks two centimetres into the floor and comes back as it came."""
    height = bounce_m(np.arange(33) / 120, 0.15, 1.0) - 0.02
    found = score_animation(replace(ball_animation(height, 120.0), materials={}), sr=8000)
    assert any("overlap by up to 2" in note for note in found.notes)
    pushed = sum(float(row["impulse_n_s"][2]) for step in found.log.steps for row in step.contacts.row)
    assert abs(pushed) == pytest.approx(0.1 * 2 * np.sqrt(2 * 9.81 * 0.15), rel=0.02)


def test_what_noise_hides_is_said() -> None:
    time_s, rng = np.arange(200) / 240, np.random.default_rng(1)
    still = ball_animation(9 - 9.81 * time_s**2 / 2, 240.0)
    place = still.position_m.copy()
    place[:, 1] += 2e-5 * rng.standard_normal((200, 3))
    notes = score_animation(replace(still, position_m=place), sr=8000).notes
    assert any("poses are good to 2" in note or "poses are good to 1" in note for note in notes)


def impacts(log: ContactLog) -> list[tuple[float, float]]:
    """Time and impulse of each that is played."""
    return [(x.start_s, x.impulse_n_s) for x in find_sound_events(log) if x.kind == "impact" and not x.reason]


@parametrize_few("fps", [24.0, 60.0, 120.0], (0, 2))
@parametrize_few("seed", [0, 1], 1)
def test_noise_is_not_played(fps: float, seed: int) -> None:
    """A ball that falls and stays where it fell, poses good to 0.3 mm: it strikes once, and rests without a rattle."""
    time_s = np.arange(int(1.1 * fps)) / fps
    fall_s, mass = np.sqrt(2 * 0.8 / 9.81), MASS_KG
    still = ball_animation(np.where(time_s < fall_s, bounce_m(time_s, 0.8, 0.0), 0.02), fps)
    place = still.position_m.copy()
    place[:, 1] += 3e-4 * np.random.default_rng(seed).standard_normal((len(place), 3))
    found = score_animation(replace(still, position_m=place, materials={"ball": "plastic"}), sr=8000)
    heard = impacts(found.log)
    hidden = mass * 5 * np.sqrt(6) * 3e-4 * fps
    assert heard[0][0] == pytest.approx(fall_s, abs=2 / min(fps, 240))
    assert heard[0][1] == pytest.approx(mass * 9.81 * fall_s, abs=hidden + 0.2 * mass * 9.81 * fall_s)
    assert not [one for one in heard[1:] if one[0] > fall_s + 0.1 or one[1] < hidden / 2]
    assert any("not played" in note for note in found.notes)


@parametrize_few("fps", [24.0, 25.0, 30.0, 48.0, 60.0], (0, 4))
@parametrize_few("restitution", [0.0, 0.3, 0.7], 1)
def test_a_landing_is_played_whole_wherever_in_a_frame_it_falls(fps: float, restitution: float) -> None:
    """m v (1 + e) within a twentieth, once. One in the last sixth of a frame was played with 84 % of it."""
    drop_m, fall_s = 0.3, float(np.sqrt(2 * 0.3 / 9.81))
    for phase in (0.02, 0.3, 0.6, 0.85, 0.97):
        frame = int(np.ceil(fall_s * fps))
        struck_s = (frame + phase) / fps
        time_s = np.arange(frame + int(0.1 * fps) + 2) / fps - struck_s + fall_s
        height = bounce_m(np.abs(time_s), drop_m, restitution)
        height[time_s > fall_s] = np.maximum(height[time_s > fall_s], RADIUS_M)
        found = score_animation(replace(ball_animation(height, fps), materials={"ball": "plastic"}), sr=8000)
        landing = [one for one in impacts(found.log) if abs(one[0] - struck_s) < 0.03]
        expected = MASS_KG * (1 + restitution) * 9.81 * fall_s
        assert [impulse for _, impulse in landing] == [pytest.approx(expected, rel=0.05)], phase
        assert landing[0][0] == pytest.approx(struck_s, abs=1 / 240), phase


def test_who_came_to_rest_carries_its_weight_and_is_struck_no_more() -> None:
    time_s, fall_s = np.arange(20) / 48, float(np.sqrt(2 * 0.1 / 9.81))
    height = np.where(time_s < fall_s, bounce_m(time_s, 0.1, 0.0), RADIUS_M)
    found = score_animation(replace(ball_animation(height, 48.0), materials={"ball": "plastic"}), sr=8000)
    assert len(impacts(found.log)) == 1
    late = found.log.steps[-50:]
    load = [abs(float(step.contacts.row["impulse_n_s"][:, 2].sum())) / step.dt_s for step in late]
    assert load == pytest.approx(np.full(50, MASS_KG * 9.81), rel=0.01)
