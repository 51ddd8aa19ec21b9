"""Below 120 frames a second: a bounce in closed form is found at any rate, and momentum is kept over frames."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.method import find_steps, substeps_of
from sonic_bullet.simulators.animated import AnimatedBody
from sonic_bullet.simulators.pybullet.staged.animated_world import AnimatedStage
from tests.few_cases import parametrize_few
from tests.made.animations import MASS_KG, RADIUS_M, ball_animation, bounce_m

GRAVITY, DROP_M, REBOUND = 9.81, 0.08, 0.7


def found(animation: Animation) -> tuple[np.ndarray, np.ndarray]:
    """Times and normal impulses of steps with a load."""
    with AnimatedStage(animation.bodies, animation.gravity_m_s2) as stage:
        steps: list[tuple[np.ndarray, np.ndarray]] = []
        find_steps(animation, stage, steps)
    step_s = 1 / animation.fps / substeps_of(animation.fps)
    impulse = np.array([raw["force_n"].sum() for _, raw in steps]) * step_s
    kept = impulse > 0
    return np.arange(len(steps))[kept] * step_s, impulse[kept]


@parametrize_few("fps", [24.0, 25.0, 60.0], 1)
def test_a_bounce_is_found(fps: float) -> None:
    """m (1 + e) √(2 g h) within a twentieth, within two steps of √(2 h / g): a step changes the speed by 4 cm/s."""
    fall_s = np.sqrt(2 * DROP_M / GRAVITY)
    time_s = np.arange(int(0.28 * fps)) / fps
    times, impulse = found(ball_animation(bounce_m(time_s, DROP_M, REBOUND), fps))
    expected = MASS_KG * (1 + REBOUND) * GRAVITY * fall_s
    assert impulse.sum() == pytest.approx(expected, rel=0.05)
    assert float(times @ impulse / impulse.sum()) == pytest.approx(fall_s, abs=2 / 240)


@pytest.mark.parametrize("restitution", [0.2, 0.9])
def test_how_it_rebounds_is_read_off_the_poses(restitution: float) -> None:
    """The body says 0.7, the poses something else; they end before it would strike again."""
    time_s = np.arange(11) / 60
    _, impulse = found(ball_animation(bounce_m(time_s, DROP_M, restitution), 60.0))
    assert impulse[impulse > 0.01].sum() == pytest.approx(
        MASS_KG * (1 + restitution) * np.sqrt(2 * GRAVITY * DROP_M), rel=0.1
    )


def test_nothing_is_found_in_the_air() -> None:
    time_s = np.arange(12) / 24
    times, _ = found(ball_animation(3 - GRAVITY * time_s**2 / 2, 24.0))
    assert len(times) == 0


def test_who_stands_is_carried_by_its_weight() -> None:
    height = np.full(14, RADIUS_M)
    bodies = ball_animation(height + np.arange(14), 24.0).bodies
    place = np.zeros((14, 2, 3))
    place[:, 0, 2], place[:, 1, 2] = -0.05, RADIUS_M
    place[-1, 1, 0] = 1e-4  # moves at last, or nothing would
    turn = np.broadcast_to([0.0, 0, 0, 1], (14, 2, 4))
    _, impulse = found(Animation(24.0, bodies, place, turn))
    assert impulse.sum() * 24 / 13 == pytest.approx(MASS_KG * GRAVITY, rel=0.05)


def test_a_hand_drives_what_it_strikes() -> None:
    """A driven ball comes down on a free one that lies there: the free one is what flies off."""
    time_s = np.arange(15) / 60
    place = np.zeros((15, 2, 3))
    place[:, 0, 0] = np.minimum(-0.1 + 0.5 * time_s, 0.02)
    speed = 0.5 * 1.4  # the free one's, after it was struck at 0.12 s
    place[:, 1, 0] = 2 * RADIUS_M - 0.1 + 0.06 + np.maximum(time_s - 0.12, 0) * speed
    turn = np.broadcast_to([0.0, 0, 0, 1], (15, 2, 4))
    free, hand = ball_animation(time_s + 1, 60.0).bodies[1], ball_animation(time_s + 1, 60.0).bodies[1]
    driven = AnimatedBody("hand", hand.shapes, hand.mass_kg, hand.inertia_kg_m2, driven=True)
    _, impulse = found(Animation(60.0, (driven, free), place, turn, np.zeros(3)))
    assert impulse.sum() == pytest.approx(MASS_KG * speed, rel=0.1)
