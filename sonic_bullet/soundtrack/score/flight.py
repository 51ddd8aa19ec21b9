"""What free flight says of an animation: gravity, and with it the scale; noise of the poses; who is moved by hand.

a(k) = (x(k+1) - 2x(k) + x(k-1)) fps²        in flight a = g, and of a noise σ in the poses √6 σ fps² is left
a hidden impulse: 5 √6 m σ fps               five standard deviations of m times the second difference's speed
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.listener.animated import PoseStage
from sonic_bullet.records import Array
from sonic_bullet.soundtrack.score.animation import Animation

STEADY = 0.1
"""Share by which an acceleration may change from frame to frame and still be a fall: air, and float32 poses."""
LEAST_FRAMES = 4
FALL_RANGE = (0.02, 5.0)
"""Falls below are a slow motion of 1:7, and above another unit of length."""
HANDED = 0.5
NEAR_M = 5e-3
SIGMAS = 5.0
MAD = 1.4826
"""Standard deviation over median absolute deviation, of a normal distribution."""


def accelerations(animation: Animation) -> Array:
    """(t - 2, b, 3) in m/s²."""
    return np.diff(animation.position_m, 2, axis=0) * animation.fps**2


def _steady(animation: Animation) -> Array:
    """(t - 3, b) whether an acceleration is the next frame's too, downwards, and some."""
    a, down = accelerations(animation), animation.gravity_m_s2
    size = np.linalg.norm(a, axis=2)
    same = np.linalg.norm(a[1:] - a[:-1], axis=2) < STEADY * size[:-1]
    along = (a @ down)[:-1] > 0.9 * size[:-1] * max(float(np.linalg.norm(down)), 1e-12)
    return np.asarray(same & along & (size[:-1] > 0.05) & animation.free)


def fall_m_s2(animation: Animation) -> float | None:
    """With what acceleration bodies fall; None where nobody does steadily. Who leans on something falls slower, nobody
    faster: the fastest tenth is free.
    """
    steady = _steady(animation)
    if steady.sum() < LEAST_FRAMES:
        return None
    return float(np.quantile(np.linalg.norm(accelerations(animation)[:-1], axis=2)[steady], 0.9))


def alone(animation: Animation, stage: PoseStage) -> Array:
    """(t, b) who is near nobody."""
    motion = animation.poses()
    found = np.zeros(motion.shape, bool)
    for k in range(len(motion)):
        low, high = stage.boxes(motion[k])
        meet = ((low[:, None] - NEAR_M <= high[None]) & (high[:, None] + NEAR_M >= low[None])).all(axis=2)
        found[k] = meet.sum(axis=1) == 1
    return found


def pose_noise_m(animation: Animation, apart: Array) -> float | None:
    """Standard deviation of a coordinate of the poses, from the third differences of flights, in which a parabola has
    none; None where nobody flies. apart (t, b): who is near nobody.
    """
    flies = apart[3:] & apart[2:-1] & apart[1:-2] & apart[:-3] & animation.free & animation.moving
    if flies.sum() < LEAST_FRAMES:
        return None
    third = np.diff(animation.position_m, 3, axis=0)[flies]  # of white noise √20 σ
    return float(MAD * np.median(np.abs(third)) / np.sqrt(20))


def hidden_n_s(mass_kg: float, noise_m: float, fps: float) -> float:
    """The smallest impulse that is told from noise in the poses."""
    return SIGMAS * float(np.sqrt(6)) * mass_kg * noise_m * fps


def driven_bodies(animation: Animation, apart: Array) -> Array:
    """(b,) who is moved by hand though nobody says so: in most frames in which it touches nothing it does not fall."""
    pull = float(np.linalg.norm(animation.gravity_m_s2))
    found = np.array([one.driven for one in animation.bodies], bool)
    if pull == 0:
        return found
    wrong = np.linalg.norm(accelerations(animation) - animation.gravity_m_s2, axis=2) > HANDED * pull
    flies = apart[2:] & apart[1:-1] & apart[:-2]
    moving = animation.moving & (np.array([one.mass_kg for one in animation.bodies]) > 0)
    enough = flies.sum(axis=0) >= LEAST_FRAMES
    share = (wrong & flies).sum(axis=0) / np.maximum(flies.sum(axis=0), 1)
    return np.asarray(found | (moving & enough & (share > HANDED)))
