"""Axes of degenerate modes: an imperfection decides about which axes two modes of one frequency lie, and a mesh is one.

    (a, b) -> (cos ψ a + sin ψ b, −sin ψ a + cos ψ b)          [Rayleigh 1894, § 221]

Their sum is the same under every ψ as long as both are linear. Not so where each depends on its own level: then ψ is
observable.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import Numbers, ObjectEvidence, RotatesPairs
from sonic_bullet.records import Array, ModalModel

AXES_PAIR = 6e-3  # relative: modes of a mesh nearer than this may be a pair
ANGLES = np.arange(18) * np.pi / 36  # a quarter turn changes the degenerate modes about, and no more


def pair_at(freq: Array, f: float) -> tuple[int, int]:
    """Find the two modes of a pair about a frequency; (-1, -1) where there is none."""
    near = np.flatnonzero(np.abs(freq / f - 1) < 2 * AXES_PAIR)
    if len(near) < 2:
        return -1, -1
    gaps = np.abs(freq[near[:-1]] + freq[near[1:]] - 2 * f) + 4 * np.diff(freq[near])
    i = int(np.argmin(gaps))
    return int(near[i]), int(near[i + 1])


def about_axes(pair: Array, turn_rad: float) -> Array:
    """Turn the shapes (…, 2) of two degenerate modes to axes at an angle ψ."""
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    a, b = pair[..., 0], pair[..., 1]
    return np.stack([c * a + s * b, -s * a + c * b], axis=-1)


def degenerate(h: ObjectEvidence, k: int) -> bool:
    """Decide whether a line stands for two modes that are degenerate in the mesh itself."""
    meshed = 1.5e-3  # relative: modes that a mesh leaves nearer to each other are degenerate modes that it split apart
    if h.model is None or h.plain is None or len(h.mode[k]) != 2:
        return False
    near = np.sort(h.plain.freq_hz[np.argsort(np.abs(h.plain.freq_hz - h.model_hz[k]))[:2]])
    return bool(near[1] / near[0] - 1 < meshed)


def split_apart(h: ObjectEvidence, k: int) -> bool:
    """Decide whether the modes of a line have different frequencies in the current model."""
    freq = h.model.freq_hz[h.mode[k]] if h.model is not None else np.zeros(0)
    # relative: degenerate modes that corrections have not brought nearer than this are played as two, and turned they
    # would be two others
    apart_share = 1e-4
    return bool(len(freq) > 1 and freq.max() / freq.min() - 1 > apart_share)


def about(h: ObjectEvidence, k: int, measure: str, angle: Array) -> tuple[Array, Array]:
    """Compute amplitudes and levels of a line's modes with degenerate modes turned by p angles.

    Parameters
    ----------
    h : ObjectEvidence
        The object.
    k : int
        Index of the line.
    measure : str
        Measure of the level, see `envelope.levels`.
    angle : (p,)
        Angles in rad.

    Returns
    -------
    amplitude, level : (p, s, j)
        Amplitudes at the sensor up to one factor, and levels.
    """
    impulse = h.level_n_s[:, None]
    if h.model is None:
        pressed = h.pressed[:, h.mode[k]].max(axis=1)[None, :, None]
        return impulse[None] * pressed, impulse[None] * pressed
    shape = np.stack([h.model.shape[:, :, m] for m in h.mode[k]], axis=2).astype(float)
    bodies = np.stack([about_axes(shape, t) for t in angle.tolist()]) if len(angle) > 1 else shape[None]  # (p, v, 3, j)
    body = np.unique(h.model.face)
    most = np.sqrt((bodies[:, body] ** 2).sum(axis=2)).max(axis=1)  # (p, j)
    push = np.einsum("psxj,sx->psj", bodies[:, h.strike_vertex], h.strike_direction)
    observed = np.einsum("pxj,x->pj", bodies[:, h.sensor_vertex], h.sensor_direction)
    level = impulse * np.abs(push) * most[:, None, :] * h.pressed[:, h.mode[k]]
    if measure == "displacement":
        level = level / (2 * np.pi * h.model.freq_hz[h.mode[k]])
    elif measure == "impulse":
        level = np.broadcast_to(impulse * h.pressed[:, h.mode[k]], push.shape)
    return impulse * h.pressed[:, h.mode[k]] * push * observed[:, None, :], level


class TurnsPairs(RotatesPairs):
    """An effect with fields freq_hz and turn_rad (p,): degenerate modes, and the angles of their axes to the mesh's."""

    freq_hz: Numbers
    turn_rad: Numbers

    def turned(self, x: ModalModel) -> ModalModel:
        """Turn degenerate modes to their own axes."""
        shape = x.shape.copy() if self.freq_hz else x.shape
        for f, turn in zip(self.freq_hz, self.turn_rad, strict=True):
            a, b = pair_at(x.freq_hz, f)
            if a >= 0:
                shape[:, :, [a, b]] = about_axes(x.shape[:, :, [a, b]], turn)
        return replace(x, shape=shape)

    def angles(self) -> int:
        """Count its numbers that are axes of degenerate pairs."""
        return len(self.turn_rad)
