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


@dataclass(frozen=True, slots=True, eq=False)
class GainFits:
    """The same (r,) of each of several expectations."""

    gain: Array
    sd: Array
    misfit: Array


def fit_gain(observed: Array, expected: Array, sd: Array, rough: Array, start: float) -> GainFit:
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
    """
    found = fit_gains(observed, expected[None], sd, rough[None], np.array([start]))
    return GainFit(float(found.gain[0]), float(found.sd[0]), float(found.misfit[0]))


def fit_gains(
    observed: Array, expected: Array, sd: Array, rough: Array, start: Array, mode: Array | None = None
) -> GainFits:
    """Fit the common gain of amplitudes under each of several expectations.

    Parameters
    ----------
    observed, sd : (n,)
        Real or complex, and spreads.
    expected, rough : (r, n)
        Expectations, and their spreads.
    start : (r,)
        Gains to start from, above zero.
    mode : (n,)
        Index of each one's mode, where modes have levels of their own at the sensor.
    """
    turns, settled = 40, 1e-10  # of the gain
    which: Array = np.zeros(len(observed), int) if mode is None else mode
    count, gain = int(which.max(initial=0)) + 1, np.array(start, float)
    size, weight = np.zeros(len(gain)), np.zeros(expected.shape)
    level, stiff = np.zeros((len(gain), count)), np.zeros((len(gain), count))

    def by_mode(value: Array) -> Array:
        own = which + count * np.arange(len(value))[:, None]
        return np.bincount(own.ravel(), value.ravel(), count * len(value)).reshape(-1, count)

    at = np.arange(len(gain))  # those that still move
    for _ in range(turns):
        before, own, off = gain[at], expected[at], rough[at]
        variance = sd**2 + (before[:, None] * off) ** 2
        model = own * (1 + MODE_LEVEL_SD * level[at][:, which])
        square = np.abs(observed - before[:, None] * model) ** 2
        weight[at] = part = cauchy_weight(square / variance / SQUARED_SCALE) / variance
        size[at] = (part * np.abs(model) ** 2).sum(axis=1)
        fitted = (part * (np.conj(model) * observed).real).sum(axis=1) / np.maximum(size[at], 1e-300)
        gain[at] = now = np.maximum(fitted, 1e-12)
        if mode is not None:
            slope = MODE_LEVEL_SD * now[:, None] * own
            left = (np.conj(slope) * (observed - now[:, None] * own)).real
            stiff[at] = by_mode(part * np.abs(slope) ** 2)
            level[at] = by_mode(part * left) / (1 + stiff[at])
        at = at[np.abs(now - before) >= settled * now]
        if not len(at):
            break
    variance = sd**2 + (gain[:, None] * rough) ** 2
    square = np.abs(observed - gain[:, None] * expected * (1 + MODE_LEVEL_SD * level[:, which])) ** 2
    misfit = (np.log(variance) + cauchy_loss(square / variance / SQUARED_SCALE, SQUARED_SCALE)).sum(axis=1)
    scatter = (weight * square).sum(axis=1) / max(len(observed) - 1, 1) / np.maximum(size, 1e-300)
    return GainFits(gain, np.sqrt(scatter), misfit + (level**2 + np.log1p(stiff)).sum(axis=1))


def misfit_about_constant(y: Array, sd: Array) -> float:
    """Compute −2 ln L of values (k,) about the best constant: of logarithms, whatever the gain."""
    middle, weight = 0.0, sd**-2.0
    for _ in range(8):
        middle = float((weight * y).sum() / weight.sum())
        weight = cauchy_weight(((y - middle) / sd) ** 2 / SQUARED_SCALE) / sd**2
    return float(cauchy_loss(((y - middle) / sd) ** 2 / SQUARED_SCALE, SQUARED_SCALE).sum())
