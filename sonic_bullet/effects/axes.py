"""Axes of twins: two modes of one frequency swing about whatever axes an imperfection gives them, and a mesh gives them any.

    (a, b) -> (cos ψ a + sin ψ b, −sin ψ a + cos ψ b)          [Rayleigh 1894, § 221]

Their sum is the same under every ψ as long as both are linear. Not so where each goes with its own level: then ψ is heard.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sonic_bullet.effects.mode_splitting import _pair
from sonic_bullet.effects.values import Heard
from sonic_bullet.records import Array, ModalModel

MESHED = 1.5e-3  # relative: modes that a mesh leaves nearer to each other are twins that it tore apart
ANGLES = np.arange(18) * np.pi / 36  # a quarter turn changes the twins about, and no more


def twins(h: Heard, k: int) -> bool:
    """Whether a line stands for two modes that the mesh itself leaves side by side."""
    if h.model is None or h.plain is None or len(h.mode[k]) != 2:
        return False
    near = np.sort(h.plain.freq_hz[np.argsort(np.abs(h.plain.freq_hz - h.model_hz[k]))[:2]])
    return bool(near[1] / near[0] - 1 < MESHED)


def about(h: Heard, k: int, measure: str, angle: Array) -> tuple[Array, Array]:
    """Amplitudes at the sensor, but for a factor, and levels (p, s, j) of the modes a line stands for, with twins turned by p angles. measure: see envelope.levels."""
    impulse = np.where(np.isfinite(h.impulse_n_s), h.impulse_n_s, 1.0)[:, None]
    if h.model is None:
        one = np.ones((1, len(impulse), 1))
        return one, impulse[None] * one
    shape = np.stack([h.model.shape[:, :, m] for m in h.mode[k]], axis=2).astype(float)
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    made = np.concatenate([c * shape[..., 0] + s * shape[..., 1], -s * shape[..., 0] + c * shape[..., 1]]) if len(angle) > 1 else None
    bodies = shape[None] if made is None else np.stack([made[: len(angle)], made[len(angle) :]], axis=-1)  # (p, v, 3, j)
    body = np.unique(h.model.face)
    most = np.sqrt((bodies[:, body] ** 2).sum(axis=2)).max(axis=1)  # (p, j)
    push = np.einsum("psxj,sx->psj", bodies[:, h.strike_vertex], h.strike_way)
    heard = np.einsum("pxj,x->pj", bodies[:, h.sensor_vertex], h.sensor_way)
    level = impulse * np.abs(push) * most[:, None, :]
    if measure == "displacement":
        level = level / (2 * np.pi * h.model.freq_hz[h.mode[k]])
    elif measure == "impulse":
        level = np.broadcast_to(impulse, push.shape)
    return push * heard[:, None, :], level


def turned(x: ModalModel, freq_hz: tuple[float, ...], turn_rad: tuple[float, ...]) -> ModalModel:
    """The model with the twins about each frequency turned to other axes."""
    if not freq_hz:
        return x
    shape = x.shape.copy()
    for f, turn in zip(freq_hz, turn_rad, strict=True):
        a, b = _pair(x.freq_hz, f)
        if a < 0:
            continue
        c, s = np.float32(np.cos(turn)), np.float32(np.sin(turn))
        shape[:, :, a], shape[:, :, b] = c * x.shape[:, :, a] + s * x.shape[:, :, b], -s * x.shape[:, :, a] + c * x.shape[:, :, b]
    return replace(x, shape=shape)
