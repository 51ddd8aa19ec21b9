"""Sensors of a run with images: behind the own ones, further microphones that stand for them beyond a face.

    own microphone, face -> `room.image_microphones.mirror_microphone`: from where the face's reflection is heard
        -> rows of channels -> mixing: summed to the own ones

Faces come with their bodies, so that places are reserved first, for so many faces of each microphone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sonic_bullet.engine.path.room.image_microphones import mirror_microphone, own_channels
from sonic_bullet.records import Array, Sensor, channels_of

MOST_FACES = 3
"""Of each microphone at a time: a corner."""


def reflection(normal: Array, offset_m: float) -> tuple[Array, Array]:
    """Compute matrix (3, 3) and shift (3,) of a reflection at the plane normal · x = offset_m."""
    return np.eye(3) - 2 * np.outer(normal, normal), 2 * offset_m * normal


def with_image_sensors(sensors: Sequence[Sensor], count: int, mixing: Array | None) -> tuple[tuple[Sensor, ...], Array]:
    """Return sensors with images of the first ``count`` behind them, and the mixing of all channels.

    mixing (rows, ·): of those given, None: each a row.
    """
    own, made = own_channels(sensors[:count]), list(sensors)
    parts = [np.eye(channels_of(sensors)) if mixing is None else mixing]
    for _ in range(MOST_FACES):
        for microphone, at in own:
            image, signs = mirror_microphone(microphone, *reflection(np.array([0.0, 0.0, 1.0]), 0.0))
            made.append(image)
            part = np.zeros((len(parts[0]), len(signs)))
            part[at + np.arange(len(signs)), np.arange(len(signs))] = signs
            parts.append(part)
    return tuple(made), np.concatenate(parts, axis=1)
