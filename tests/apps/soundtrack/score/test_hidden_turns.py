"""Frame rates that hide how a body turns: said, and nothing is played that its poses do not force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.scoring import score_animation
from sonic_bullet.records import Array, Shape
from sonic_bullet.records.errors import AnimationError
from sonic_bullet.simulators.animated import AnimatedBody
from tests.few_cases import parametrize_few
from tests.made.animations import FLOOR_M, floor_body

STICK, COIN, DIE, WHEEL = (0.3, 0.02, 0.02), (0.04, 0.04, 0.003), (0.04, 0.04, 0.04), (0.2, 0.2, 0.02)


def thrown(
    edges: Any, fps: float, turns_a_s: float, axis: Any, *, frames: int = 20, lands_m: float | None = None
) -> Animation:
    """A box of 100 g that turns in flight about a principal axis, its centre on a parabola; lands_m: from when on its
    centre is that low again it flies up at half the speed.
    """
    size, axis = np.array(edges), np.array(axis, float) / np.linalg.norm(axis)
    time_s = np.arange(frames) / fps
    height = 0.5 + 1.5 * time_s - 9.81 * time_s**2 / 2
    if lands_m is not None:
        hit_s = (1.5 + np.sqrt(1.5**2 + 2 * 9.81 * (0.5 - lands_m))) / 9.81
        after, speed = time_s - hit_s, 0.5 * (9.81 * hit_s - 1.5)
        height = np.where(after < 0, height, lands_m + speed * after - 9.81 * after**2 / 2)
    half = np.pi * turns_a_s * time_s
    quaternion = np.concatenate([np.sin(half)[:, None] * axis, np.cos(half)[:, None]], axis=1)
    place, turn = np.zeros((frames, 2, 3)), np.zeros((frames, 2, 4))
    place[:, 0, 2], place[:, 1, 2], turn[:, 0, 3], turn[:, 1] = -FLOOR_M[2] / 2, height, 1.0, quaternion
    x, y, z = size**2
    inertia = 0.1 / 12 * np.array([y + z, x + z, x + y])
    body = AnimatedBody("stick", (Shape("box", size),), 0.1, inertia, 0.5)
    return Animation(fps, (floor_body(), body), place, turn, materials={"stick": "wood"})


def given_n_s(animation: Animation) -> tuple[float, tuple[str, ...]]:
    found = score_animation(animation, sr=8000)
    up = sum(abs(float(row["impulse_n_s"][2])) for step in found.log.steps for row in step.contacts.row)
    return up, found.notes


@parametrize_few(
    ("edges", "fps", "turns_a_s", "axis"),
    [(STICK, 24, 15, (0, 1, 0)), (COIN, 25, 16, (1, 0, 0)), (DIE, 30, 19, (0, 0, 1)), (WHEEL, 12, 7, (1, 0, 0))],
    2,
)
def test_who_turns_unseen_above_the_floor_is_not_struck(edges: Any, fps: float, turns_a_s: float, axis: Any) -> None:
    """It flies past the floor, nearer than half its length, and falls all the time."""
    frames = int(fps * 0.38)
    animation = thrown(edges, fps, turns_a_s, axis, frames=frames)
    place = animation.position_m.copy()
    place[:, 1, 2] += 0.011 - place[-1, 1, 2] + edges[2] / 2  # its last frame nearly touches
    given, notes = given_n_s(
        Animation(fps, animation.bodies, place, animation.quaternion_xyzw, materials=animation.materials)
    )
    assert given == 0
    assert any("frames a second hide how 'stick' turns" in note for note in notes)
    assert not any("overlap" in note for note in notes)


@pytest.mark.parametrize("turns_a_s", [0.5, 2.0, 5.0])
def test_who_turns_slowly_is_seen(turns_a_s: float) -> None:
    _, notes = given_n_s(thrown(COIN, 24, turns_a_s, (1, 0, 0)))
    assert not any("hide" in note for note in notes)


@pytest.mark.parametrize(
    ("bad", "said"),
    [((0, 0, 0, 0), "zero"), ((0, 0, 0, 2), "2 long, not 1"), ((np.nan, 0, 0, 1), "no number"),
     ((0, 0, 0.4, 0.4), "0.566 long")],
)  # fmt: skip
def test_a_quaternion_that_is_none_is_named_with_body_and_frame(bad: Array, said: str) -> None:
    animation = thrown(DIE, 24, 2, (1, 0, 0))
    turn = animation.quaternion_xyzw.copy()
    turn[7, 1] = bad
    with pytest.raises(AnimationError, match=rf"'stick' in frame 7 .*{said}"):
        Animation(24, animation.bodies, animation.position_m, turn)
