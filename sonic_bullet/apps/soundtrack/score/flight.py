"""Estimates from free flight: gravity, and with it the scale; noise of the poses; driven bodies.

a(k) = (x(k+n) - 2x(k) + x(k-n)) (fps/n)²    in flight a = g, and of a noise σ in the poses √6 σ (fps/n)² is left
a hidden impulse: 5 √6 m σ fps               five standard deviations of m times the second difference's speed
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.apps.soundtrack.score.animation import Animation
from sonic_bullet.apps.soundtrack.score.impulse_fit import near_pairs, speeds
from sonic_bullet.records import Array
from sonic_bullet.signal.robust import normal_sd
from sonic_bullet.simulators.animated import PoseStage

# relative change of an acceleration from frame to frame that is still a fall: air, and float32 poses
STEADY_FALL = 0.1
LEAST_FALLING_FRAMES = 4
NOISE_SIGMAS = 5.0  # standard deviations of the poses' noise that noise alone does not reach
REST_FRAMES = 16  # of a rest from which noise is estimated; see _rests
WHITE_RATIO = 5.0  # power of third over first differences: white noise has 10, motion less
REST_NOISE_RATIO = 4.0  # of the noise of a rest over that of the quietest one


def accelerations(animation: Animation, apart: int = 1) -> Array:
    """Compute accelerations (t - 2 apart, b, 3) in m/s², from poses so many frames apart."""
    x = animation.position_m
    second = x[2 * apart :] - 2 * x[apart : len(x) - apart] + x[: -2 * apart]
    return np.asarray(second * (animation.fps / apart) ** 2)


def frames_apart(animation: Animation, noise_m: float | None, within_m_s2: float) -> int:
    """Return how many frames apart poses resolve an acceleration above noise.

    5 √6 √3 σ (fps/n)², of all three coordinates, is no more than it.
    """
    noise_m_s2 = 0.0 if noise_m is None else NOISE_SIGMAS * float(np.sqrt(18)) * noise_m * animation.fps**2
    frames = int(np.ceil(np.sqrt(noise_m_s2 / max(within_m_s2, 1e-12))))
    return min(max(frames, 1), (len(animation) - 1) // 2)


def _steady(a: Array, animation: Animation) -> Array:
    """Return (a - 1, b) whether an acceleration is the next frame's too, downwards, and not small."""
    down = animation.gravity_m_s2
    size = np.linalg.norm(a, axis=2)
    same = np.linalg.norm(a[1:] - a[:-1], axis=2) < STEADY_FALL * size[:-1]
    along = (a @ down)[:-1] > 0.9 * size[:-1] * max(float(np.linalg.norm(down)), 1e-12)
    return np.asarray(same & along & (size[:-1] > 0.05) & animation.free)


def fall_m_s2(animation: Animation, noise_m: float | None = None) -> float | None:
    """Estimate the acceleration of falling bodies; None where none falls steadily.

    A body that leans on something falls slower, none faster: the fastest tenth is free.
    """
    within_m_s2 = STEADY_FALL * float(np.linalg.norm(animation.gravity_m_s2))
    a = accelerations(animation, frames_apart(animation, noise_m, within_m_s2))
    steady = _steady(a, animation)
    if steady.sum() < LEAST_FALLING_FRAMES:
        return None
    return float(np.quantile(np.linalg.norm(a[:-1], axis=2)[steady], 0.9))


def alone(animation: Animation, stage: PoseStage) -> Array:
    """Return (t, b) which bodies touch no other from a frame before to a frame after, by their distance."""
    near_m = 5e-3
    motion, step_s = animation.poses(), 1 / animation.fps
    fall_m = float(np.linalg.norm(animation.gravity_m_s2)) * step_s**2
    speed_m_s = np.stack([speeds(one, stage.reach_m) for one in motion])
    speed_m_s[:-1] = np.maximum(speed_m_s[:-1], speed_m_s[1:])
    found = np.ones(motion.shape, bool)
    for k in range(len(motion)):
        pairs = near_pairs(motion[k], stage.reach_m, speed_m_s[k] * step_s + fall_m + near_m, ~animation.moving, stage)
        found[k, [one for pair in pairs for one in pair]] = False
    return found


def pose_noise_m(animation: Animation, apart: Array) -> float | None:
    """Estimate the standard deviation of the noisiest coordinate of the poses; None where nothing flies or rests.

    From the third differences of flights, in which a parabola has none, or else of bodies at rest, which show no
    rounding. apart (t, b): which bodies are near no other.
    """
    flies = apart[3:] & apart[2:-1] & apart[1:-2] & apart[:-3]
    who = animation.free & animation.moving
    calm = flies & who
    if calm.sum() < LEAST_FALLING_FRAMES:
        calm[:, who] = _rests(animation.position_m[:, who])
    if calm.sum() < LEAST_FALLING_FRAMES:
        return None
    third = np.diff(animation.position_m, 3, axis=0)[calm]  # of white noise √20 σ
    return float(normal_sd(third, 0).max() / np.sqrt(20))


def _rests(position_m: Array) -> Array:
    """Return (t - 3, b) third differences in `REST_FRAMES` of white noise alone.

    In every coordinate mean squares of third differences are ten times those of first ones, 20 σ² and 2 σ²; where
    something moves they are less. No such time is much louder than the quietest: rattling decays, noise does not.
    """
    found = np.zeros((max(len(position_m) - 3, 0), position_m.shape[1]), bool)
    if len(position_m) < REST_FRAMES or not position_m.shape[1]:
        return found
    first, third = (
        np.lib.stride_tricks.sliding_window_view(np.diff(position_m, n, axis=0) ** 2, REST_FRAMES - n, axis=0).mean(-1)
        for n in (1, 3)
    )
    loud = third.sum(axis=2)
    white = (third > WHITE_RATIO * first).all(axis=2) & (loud < REST_NOISE_RATIO**2 * loud.min())
    for k in range(REST_FRAMES - 3):
        found[k : k + len(white)] |= white
    return found


def hidden_n_s(mass_kg: float, noise_m: float, fps: float) -> float:
    """Compute the smallest impulse that can be distinguished from noise in the poses."""
    return NOISE_SIGMAS * float(np.sqrt(6)) * mass_kg * noise_m * fps


def driven_bodies(animation: Animation, apart: Array, noise_m: float | None = None) -> Array:
    """Find bodies (b,) that are driven though not marked: in most frames without contact they do not fall."""
    handed = 0.5
    pull = float(np.linalg.norm(animation.gravity_m_s2))
    found = np.array([one.driven for one in animation.bodies], bool)
    if pull == 0:
        return found
    frames = frames_apart(animation, noise_m, handed * pull)
    fall = accelerations(animation, frames) - animation.gravity_m_s2
    wrong = np.linalg.norm(fall, axis=2) > handed * pull
    flies = np.lib.stride_tricks.sliding_window_view(apart, 2 * frames + 1, axis=0).all(axis=2)
    moving = animation.moving & (np.array([one.mass_kg for one in animation.bodies]) > 0)
    enough = flies.sum(axis=0) >= LEAST_FALLING_FRAMES
    share = (wrong & flies).sum(axis=0) / np.maximum(flies.sum(axis=0), 1)
    return np.asarray(found | (moving & enough & (share > handed)))


def hidden_turns(animation: Animation) -> Array:
    """Return (t - 1, b) which bodies rotate so fast from a frame to the next that poses do not determine it."""
    # rotation from frame to frame above which the frame rate hides how a body rotates: it is known but for whole turns,
    # and the next that fits, 2π less this one the other way, is no three times as fast
    quarter_rad = np.pi / 2
    return np.asarray((animation.turn_rad > quarter_rad) & animation.free)


def find_unforced(animation: Animation, noise_m: float | None) -> Array:
    """Return (t - 1, b) which bodies rotate by a hidden amount while their centre falls as without contact.

    At either end of the interval the second difference of its places is gravity's to a tenth of it and to what
    noise hides.
    """
    fall_m_s = float(np.linalg.norm(animation.gravity_m_s2)) / animation.fps
    least_m_s = STEADY_FALL * fall_m_s + (0.0 if noise_m is None else hidden_n_s(1.0, noise_m, animation.fps))
    off = (accelerations(animation) - animation.gravity_m_s2) / animation.fps
    given = np.zeros(animation.position_m.shape[:2], bool)
    given[1:-1] = np.linalg.norm(off, axis=2) > least_m_s
    return np.asarray(hidden_turns(animation) & ~(given[:-1] | given[1:]))
