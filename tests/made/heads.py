"""A head by closed forms: two ears on a sphere, each response a delayed low-passed pulse, and its SOFA file."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sonic_bullet.records import Array, Head

RADIUS_M = 0.0875
EARLY = 40
"""Samples before the nearest ear's response."""


def directions(step_deg: int = 10) -> Array:
    """(d, 3) unit vectors every so many degrees of azimuth and elevation."""
    found = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)]
    for elevation in range(-90 + step_deg, 90, step_deg):
        for azimuth in range(0, 360, step_deg):
            a, e = np.radians([azimuth, elevation])
            found.append((np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)))
    return np.array(found)


def delay_s(direction: Array) -> Array:
    """(d, 2) of the left and the right ear, over the middle's: Woodworth's sphere (1938)."""
    lateral = np.stack([direction[:, 1], -direction[:, 1]], axis=1)
    angle = np.arccos(np.clip(lateral, -1, 1))
    near = -RADIUS_M / 343 * np.cos(angle)
    return np.where(angle < np.pi / 2, near, RADIUS_M / 343 * (angle - np.pi / 2))


def gain(direction: Array) -> Array:
    """(d, 2) of the ears: 6 dB from side to side."""
    return 1 + 0.33 * np.stack([direction[:, 1], -direction[:, 1]], axis=1)


def head(sr: int = 48_000, direction: Array | None = None, taps: int = 128) -> Head:
    """The head, at directions (d, 3)."""
    direction = directions() if direction is None else np.atleast_2d(direction)
    late = EARLY / 48_000 * sr + delay_s(direction) * sr
    t = (np.arange(taps) - late[..., None]) * 48_000 / sr
    width = 6.0
    pulse = (
        np.sinc(0.8 * t) * 0.8 * np.where(np.abs(t) < 3 * width, np.cos(np.pi * t / (6 * width)) ** 2, 0) * 48_000 / sr
    )
    return Head(direction, gain(direction)[..., None] * pulse, sr, "sphere.sofa")


def write_sofa(path: Path, one: Head) -> None:
    """The SOFA file of a head, spherical directions."""
    import sofar

    made = sofar.Sofa("SimpleFreeFieldHRIR")
    azimuth = np.degrees(np.arctan2(one.direction[:, 1], one.direction[:, 0])) % 360
    elevation = np.degrees(np.arcsin(one.direction[:, 2]))
    made.SourcePosition = np.stack([azimuth, elevation, np.full(len(azimuth), 1.5)], axis=1)
    made.Data_IR = np.asarray(one.response)
    made.Data_SamplingRate = one.sr
    sofar.write_sofa(str(path), made)
