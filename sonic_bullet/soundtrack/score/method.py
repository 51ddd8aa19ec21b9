"""Which way the contacts of an animation are found, and the steps that the run time is given."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil

from sonic_bullet.listener.animated import PoseStage
from sonic_bullet.records import Array
from sonic_bullet.soundtrack.score.animation import Animation
from sonic_bullet.soundtrack.score.impulse_fit import fitted_steps
from sonic_bullet.soundtrack.score.shooting import Shooting

FIT_FROM_FPS = 119.0
STEP_HZ = 240.0


def found_steps(
    animation: Animation, stage: PoseStage, progress: Callable[[float], None] | None = None
) -> tuple[list[tuple[Array, Array]], float]:
    """MOTION (b,) at the start of each step with its loaded RAW rows, and the length of a step in s."""
    if animation.fps >= FIT_FROM_FPS:
        return fitted_steps(animation, stage, stage.reach_m, progress), 1 / animation.fps
    substeps = ceil(STEP_HZ / animation.fps - 1e-9)
    return Shooting(animation, stage, substeps).steps(progress), 1 / animation.fps / substeps
