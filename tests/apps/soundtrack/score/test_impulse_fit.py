"""Impulses from second differences: closed forms of a fall, a bounce, a turn, a rest, a push between two."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import fit_steps, momentum_changes
from sonic_bullet.records import Array, Shape
from sonic_bullet.simulators.animated import AnimatedBody
from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage
from tests.made.animations import MASS_KG, RADIUS_M, ball_animation, ball_body, bounce_m

FPS, GRAVITY = 240.0, 9.81


def wrench(animation: Animation) -> Array:
    return momentum_changes(animation, animation.poses())


def impulses(animation: Animation) -> Array:
    """(t,) normal impulse that is found at each frame, all places together."""
    with AnimatedStage(animation.bodies, animation.gravity_m_s2) as stage:
        steps: list[tuple[Array, Array]] = []
        fit_steps(animation, stage, steps)
    return np.array([raw["force_n"].sum() for _, raw in steps]) / animation.fps


@pytest.mark.parametrize("fps", [120.0, 240.0, 1000.0])
def test_a_fall_needs_no_contact(fps: float) -> None:
    """x = h - g t²/2 has the second difference -g T² exactly, at any rate."""
    time_s = np.arange(30) / fps
    still = ball_animation(5 - GRAVITY * time_s**2 / 2, fps)
    assert np.abs(wrench(still)).max() < 1e-9 * MASS_KG * fps


@pytest.mark.parametrize("drop_m", np.linspace(0.02, 0.15, 7).tolist())
def test_a_bounce_gives_its_impulse_wherever_in_a_frame_it_falls(drop_m: float) -> None:
    """m (1 + e) √(2 g h), the triangle's two samples together."""
    animation = ball_animation(bounce_m(np.arange(70) / FPS, drop_m, 0.6), FPS)
    expected = MASS_KG * 1.6 * np.sqrt(2 * GRAVITY * drop_m)
    assert wrench(animation)[:, 1, 2].sum() == pytest.approx(expected, rel=1e-9)
    found = impulses(animation)
    assert found.sum() == pytest.approx(expected, rel=1e-3)
    assert np.count_nonzero(found > 1e-3 * expected) <= 2
    middle_s = float(found @ np.arange(len(found)) / found.sum() / FPS)
    assert middle_s == pytest.approx(np.sqrt(2 * drop_m / GRAVITY), abs=2e-4)


def test_a_weight_at_rest_is_carried() -> None:
    found = impulses(ball_animation(np.concatenate([np.full(20, RADIUS_M), [0.5]]), FPS))
    assert found[2:18] == pytest.approx(np.full(16, MASS_KG * GRAVITY / FPS), rel=1e-3)


def test_a_free_turn_keeps_its_angular_momentum() -> None:
    """A body of three equal moments turns at one speed; nothing is needed for it."""
    from scipy.spatial.transform import Rotation

    time_s = np.arange(40) / FPS
    axis = np.array([0.6, -0.48, 0.64]) * 25.0
    turn = Rotation.from_rotvec(time_s[:, None] * axis).as_quat()[:, None]
    place = np.stack([0 * time_s, 0 * time_s, 5 - GRAVITY * time_s**2 / 2], axis=1)[:, None]
    animation = Animation(FPS, (ball_body(),), place, turn)
    momentum = 0.4 * MASS_KG * RADIUS_M**2 * 25.0
    assert np.abs(wrench(animation)[:, :, 3:]).max() < 1e-9 * momentum


def test_two_that_meet_give_each_other_the_same() -> None:
    """Head on, without gravity: both change their momentum by the impulse that is found, once."""
    time_s, speed = np.arange(40) / FPS, 1.0
    meet_s = 20.3 / FPS
    gap = np.maximum(meet_s - time_s, 0) * speed + np.maximum(time_s - meet_s, 0) * speed / 2
    place = np.zeros((len(time_s), 2, 3))
    place[:, 0, 0], place[:, 1, 0] = -RADIUS_M - gap, RADIUS_M + gap
    turn = np.broadcast_to([0.0, 0, 0, 1], (len(time_s), 2, 4))
    bodies = (ball_body("left"), ball_body("right"))
    animation = Animation(FPS, bodies, place, turn, np.zeros(3))
    change = wrench(animation)
    assert np.abs(change.sum(axis=1)).max() < 1e-12
    assert impulses(animation).sum() == pytest.approx(MASS_KG * 1.5 * speed, rel=1e-3)


def test_who_is_driven_is_pushed_and_tells_nothing() -> None:
    """A hand that carries a ball up in the air presses on nobody."""
    body = AnimatedBody("hand", (Shape("sphere", np.array([0.02, 0, 0])),), 0.1, np.full(3, 1e-5), driven=True)
    time_s = np.arange(20) / FPS
    place = np.stack([0 * time_s, 0 * time_s, 1 + np.sin(9 * time_s)], axis=1)[:, None]
    animation = Animation(FPS, (body,), place, np.broadcast_to([0.0, 0, 0, 1], (20, 1, 4)))
    assert not impulses(animation).any()


def test_noise_that_is_known_does_not_rattle_what_stands() -> None:
    """Poses of a ball that stands, good to 20 µm: it is carried by its weight; unknown, the noise would shake it."""
    rng, sigma_m = np.random.default_rng(3), 2e-5
    animation = ball_animation(RADIUS_M + sigma_m * rng.standard_normal(60), FPS)
    motion = animation.poses()
    weight = MASS_KG * GRAVITY / FPS
    known = momentum_changes(animation, motion, 5 * np.sqrt(6) * sigma_m * FPS)[1:-1, 1, 2]
    assert known == pytest.approx(np.full(58, weight), rel=1e-6)
    assert momentum_changes(animation, motion)[1:-1, 1, 2].std() > 0.2 * weight
