"""Axes of degenerate modes in an observed object: which lines have some, and their levels about turned axes."""

from __future__ import annotations

import numpy as np

from sonic_bullet.effects.common.axes import about_axes
from sonic_bullet.lab.effects.evidence import ObjectEvidence
from sonic_bullet.records import Array

ANGLES = np.arange(18) * np.pi / 36  # a quarter turn changes the degenerate modes about, and no more


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
