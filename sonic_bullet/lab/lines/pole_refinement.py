"""Poles at the least sum of squares, their amplitudes projected out: the descent of every extractor of lines.

    (M + μ diag M) δ = g                                                          [Levenberg 1944; Marquardt 1963]
    M, g of Gauss and Newton for the poles alone, with amplitudes that are the best there
                                                                         [Golub & Pereyra 1973; Kaufman 1975]

Samples of a tap or of several takes (projection.py), bands after an attack and frequency responses differ in how M, g
and the sum of squares follow from poles, and in nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

import numpy as np

from sonic_bullet.records import Array


class PoleEquations(Protocol):
    """What a sum of squares says of poles (k,).

    matrix (q k, q k) and gradient (q k,): of a step, q numbers a pole. cost: the sum, up to a factor.
    """

    @property
    def matrix(self) -> Array:
        """Return M."""

    @property
    def gradient(self) -> Array:
        """Return g."""

    @property
    def cost(self) -> float:
        """Return the sum of squares."""


Solved = TypeVar("Solved", bound=PoleEquations)


def refine_poles(
    equations: Callable[[Array], Solved],
    pole: Array,
    units: Sequence[complex],
    *,
    bound: Callable[[Array], Array] = np.asarray,
    steps: int = 12,
    settled: float = 1e-3,
    relative: float = 0.0,
    slack: float = 1.0,
) -> tuple[Array, Solved]:
    """Refine poles (k,) and return them with what their equations hold.

    Parameters
    ----------
    equations : callable
        Of poles (k,).
    pole : (k,)
        To start from, −d + iω.
    units : (q,)
        By how much each of the equations' numbers moves a pole.
    bound : callable
        Brings poles into the range that is searched.
    steps : int
        At most.
    settled, relative : float
        Fall of the cost that ends the search: in its own units, and as a part of it.
    slack : float
        By how much a pole may move in a step beside half of its decay.
    """
    solved, lift, highest = equations(pole), 1e-4, 1e4
    for _ in range(steps if len(pole) else 0):
        scale = 1 / np.sqrt(np.maximum(np.diag(solved.matrix).real, 1e-300))
        unit = solved.matrix * scale[:, None] * scale + lift * np.eye(len(scale))
        step = np.array(units) @ (scale * np.linalg.solve(unit, solved.gradient * scale)).reshape(len(units), -1)
        reach = 0.5 * np.abs(pole.real) + slack
        trial = bound(pole + np.clip(step.real, -reach, reach) + 1j * np.clip(step.imag, -reach, reach))
        found = equations(trial)
        if not found.cost < solved.cost:
            lift *= 30
            if lift > highest:
                break
            continue
        fall, pole, solved, lift = solved.cost - found.cost, trial, found, max(lift / 10, 1e-12)
        if fall < max(settled, relative * solved.cost):
            break
    return pole, solved


def bound_poles(band_hz: tuple[float, float], slowest_per_s: float, fastest_per_s: float) -> Callable[[Array], Array]:
    """Return the bound of poles in 1/s to a band and a range of decays."""
    low, high = 2 * np.pi * band_hz[0], 2 * np.pi * band_hz[1]
    return lambda pole: np.asarray(
        np.clip(pole.real, -fastest_per_s, -slowest_per_s) + 1j * np.clip(pole.imag, low, high)
    )
