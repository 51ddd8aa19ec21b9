"""Choice of the method that finds an animation's contacts, and of the run time's steps."""

from __future__ import annotations

from math import ceil

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import fit_steps
from sonic_bullet.apps.soundtrack.score.shooting import Shooting
from sonic_bullet.records import Array
from sonic_bullet.simulators.animated import PoseStage

FIT_FROM_FPS = 119.0


def substeps_of(fps: float) -> int:
    """Return the number of steps to a frame."""
    step_hz = 240.0
    return 1 if fps >= FIT_FROM_FPS else ceil(step_hz / fps - 1e-9)


def find_steps(
    animation: Animation,
    stage: PoseStage,
    found: list[tuple[Array, Array]],
    *,
    hidden_m_s: float = 0.0,
) -> None:
    """Append MOTION (b,) at the start of each step with its loaded RAW rows: interrupted, those so far stay.

    hidden_m_s: the change of speed from frame to frame that noise in the poses hides.
    """
    if animation.fps >= FIT_FROM_FPS:
        fit_steps(animation, stage, found, hidden_m_s=hidden_m_s)
    else:
        Shooting(animation, stage, substeps_of(animation.fps), hidden_m_s).find_steps(found)
