"""Axes of degenerate modes: an imperfection decides about which axes two modes of one frequency lie, and a mesh is one.

    (a, b) -> (cos ψ a + sin ψ b, −sin ψ a + cos ψ b)          [Rayleigh 1894, § 221]

Their sum is the same under every ψ as long as both are linear. Not so where each depends on its own level: then ψ is
observable.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from sonic_bullet.effects.protocol import Numbers, RotatesPairs
from sonic_bullet.records import Array, ModalModel

AXES_PAIR = 6e-3  # relative: modes of a mesh nearer than this may be a pair


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


class TurnsPairs(RotatesPairs):
    """An effect with fields freq_hz and turn_rad (p,): degenerate modes, and the angles of their axes to the mesh's."""

    freq_hz: Numbers
    turn_rad: Numbers

    def turn_pairs(self, x: ModalModel) -> ModalModel:
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
