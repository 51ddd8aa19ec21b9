"""The likelihood of observed lines: decays and complex amplitudes over their spreads, under Cauchy's law.

    −2 ln L = Σ ln v + c² ln(1 + |y − x|²/c²v)                                     [Holland & Welsch 1977, table 1]
    decays      y − x = ln d_k/d_j,  v = (σ_d/d)² + 0.02²
    amplitudes  x = g E (1 + 0.05 u),  v = σ² + (g rough)²,  g common to all, at its best; rough: the shapes' own error
                u ~ N(0, 1): a mode's level at the sensor, off at all strikes alike, integrated out by Laplace's method
                where it is asked for                                                         [Tierney & Kadane 1986]

Of clicks, neighbours and wrong pairs lines lie far off: beyond c spreads they hardly count. c is 3, of decays 2, which
are misread more often.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.robust import cauchy_loss, cauchy_weight

SQUARED_SCALE = 9.0
"""c² of amplitudes."""
DECAY_SCALE = 2.0
"""c of decays."""
MODE_LEVEL_SD = 0.05
"""Relative: by how much a mode's level at the sensor is off at all strikes alike."""


def decay_residuals(decay_per_s: Array, sd_per_s: Array, model_per_s: Array) -> Array:
    """Compute ln of lines' decays (k,) over a model's, in spreads: 5 % where unknown, ∞ where there is no value."""
    scatter = 0.02  # of a decay about any law, that no model is asked to explain
    with np.errstate(divide="ignore", invalid="ignore"):
        sd = np.hypot(np.nan_to_num(sd_per_s / decay_per_s, nan=0.05, posinf=1e3), scatter)
        return np.asarray(np.log(decay_per_s / np.maximum(model_per_s, 1e-9)) / sd)


def decay_misfit(decay_per_s: Array, sd_per_s: Array, model_per_s: Array) -> Array:
    """Compute −2 ln L (k,) of lines' decays."""
    z = decay_residuals(decay_per_s, sd_per_s, model_per_s)
    return cauchy_loss((z / DECAY_SCALE) ** 2, DECAY_SCALE**2)


@dataclass(frozen=True, slots=True, eq=False)
class GainFit:
    """The common gain of amplitudes, its standard error, and −2 ln L there."""

    gain: float
    sd: float
    misfit: float


def fit_gain(
    observed: Array, expected: Array, sd: Array, rough: Array, start: float, mode: Array | None = None
) -> GainFit:
    """Fit the common gain of amplitudes.

    Parameters
    ----------
    observed, expected : (n,)
        Real or complex.
    sd : (n,)
        Of the observed.
    rough : (n,)
        Of the expected.
    start : float
        Gain to start from, above zero.
    mode : (n,)
        Index of each one's mode, where modes have levels of their own at the sensor.
    """
    turns, settled = 40, 1e-10  # of the gain
    which = np.zeros(len(observed), int) if mode is None else mode
    gain, size = start, 0.0
    level = stiff = np.zeros(int(which.max(initial=0)) + 1)
    for _ in range(turns):
        variance = sd**2 + (gain * rough) ** 2
        model = expected * (1 + MODE_LEVEL_SD * level[which])
        weight = cauchy_weight(np.abs(observed - gain * model) ** 2 / variance / SQUARED_SCALE) / variance
        size = float((weight * np.abs(model) ** 2).sum())
        before = gain
        gain = max(float((weight * (np.conj(model) * observed).real).sum() / max(size, 1e-300)), 1e-12)
        if mode is not None:
            slope = MODE_LEVEL_SD * gain * expected
            left = (np.conj(slope) * (observed - gain * expected)).real
            stiff = np.bincount(mode, weight * np.abs(slope) ** 2)
            level = np.bincount(mode, weight * left) / (1 + stiff)
        if abs(gain - before) < settled * gain:
            break
    variance = sd**2 + (gain * rough) ** 2
    square = np.abs(observed - gain * expected * (1 + MODE_LEVEL_SD * level[which])) ** 2
    misfit = (np.log(variance) + cauchy_loss(square / variance / SQUARED_SCALE, SQUARED_SCALE)).sum()
    scatter = float((weight * square).sum()) / max(len(observed) - 1, 1) / max(size, 1e-300)
    return GainFit(gain, float(np.sqrt(scatter)), float(misfit + (level**2 + np.log1p(stiff)).sum()))


def misfit_about_constant(y: Array, sd: Array) -> float:
    """Compute −2 ln L of values (k,) about the best constant: of logarithms, whatever the gain."""
    middle, weight = 0.0, sd**-2.0
    for _ in range(8):
        middle = float((weight * y).sum() / weight.sum())
        weight = cauchy_weight(((y - middle) / sd) ** 2 / SQUARED_SCALE) / sd**2
    return float(cauchy_loss(((y - middle) / sd) ** 2 / SQUARED_SCALE, SQUARED_SCALE).sum())
