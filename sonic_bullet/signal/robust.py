"""Losses, weights and fits that outliers do not decide.

Huber    ρ(z) = z²/2 up to |z| = c, c|z| − c²/2 beyond,  weight min(1, c/|z|)        [Huber 1964, eq. 1.2]
Cauchy   ρ(z) = c²/2 ln(1 + z²/c²),  weight 1/(1 + z²/c²)                           [Holland & Welsch 1977, table 1]
σ = median |z| / Φ⁻¹(3/4) of a normal law about 0                                   [Hampel 1974, sec. 5.1]

z: residuals in standard deviations. Fits: least squares, weighted anew by what they leave.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.records import Array


def cauchy_loss(square: Array, squared_scale: float) -> Array:
    """Compute twice Cauchy's loss, c² ln(1 + z²/c²), of squares z²/c²."""
    return np.asarray(squared_scale * np.log1p(square))


def cauchy_weight(square: Array) -> Array:
    """Compute Cauchy's weight, 1/(1 + z²/c²), of squares z²/c²."""
    return np.asarray(1 / (1 + square))


def normal_sd(centred: Array, axis: int | None = None) -> Array:
    """Estimate the standard deviation of normal values about 0 by the median of their magnitudes."""
    ratio = 1.4826  # 1/Φ⁻¹(3/4)
    return np.asarray(ratio * np.median(np.abs(centred), axis=axis))


def fit_linear(
    off: Array, slope: Array, sd: Array, precision: Array, pull: Array, weight: Array | float = 1.0, scale: float = 2.5
) -> tuple[Array, Array, Array]:
    """Fit numbers (q,) that take slope (k, q) of residuals off (k,) ± sd each: a step of Gauss and Newton.

    Under Cauchy's loss, c = scale, and a prior of a precision (q, q), times which the numbers are drawn by pull (q,).
    Returns them, the information (q, q) of the residuals alone, and what Cauchy's weights have left of each (k,).
    """
    trust, step, information = np.ones(len(off)), np.zeros(len(pull)), np.zeros(precision.shape)
    for _ in range(8):
        column = slope * (weight * trust / sd**2)[:, None]
        information = column.T @ slope
        lift = 1e-12 * np.trace(information) * np.eye(len(pull))  # of what nothing tells, the least step is taken
        step = np.linalg.solve(information + precision + lift, column.T @ off + pull)
        trust = cauchy_weight(((off - slope @ step) / sd / scale) ** 2)
    return step, information, trust


def fit_nonnegative(y: Array, sd: Array, columns: Array) -> tuple[Array, Array]:
    """Fit coefficients >= 0 of columns under Huber's loss.

    Parameters
    ----------
    y : (k,)
        Data.
    sd : (k,)
        Their standard deviations.
    columns : (k, c)
        Columns of any scale.

    Returns
    -------
    value : (c,)
        Coefficients; 0 where no datum tells.
    left : (k,)
        Twice Huber's losses, c = 3.

    References
    ----------
    Huber's weights [Huber 1964] on least squares without negative numbers [Lawson & Hanson 1974, ch. 23].
    """
    from scipy.optimize import nnls

    weight = 1 / sd
    size = np.sqrt(((columns * weight[:, None]) ** 2).sum(axis=0))
    scale = np.divide(1, size, out=np.zeros(len(size)), where=size > 0)  # of what nothing is known, nothing is said
    a, b = columns * scale * weight[:, None], y * weight
    trust, x = np.ones(len(y)), np.zeros(columns.shape[1])
    for _ in range(8):
        root = np.sqrt(trust)
        x = nnls(a * root[:, None], b * root)[0]
        before, trust = trust, np.minimum(1.0, 3.0 / np.maximum(np.abs(b - a @ x), 1e-12))
        if np.abs(trust - before).max() < 1e-3:
            break
    off = np.abs(b - a @ x)
    return x * scale, np.where(off <= 3, off**2, 6 * off - 9)


def weighted_median(value: Array, weight: Array) -> float:
    """Return the least of values (k,) up to which they hold half of the weights (k,)."""
    order = np.argsort(value, kind="stable")
    total = np.cumsum(weight[order])
    return float(value[order][np.searchsorted(total, total[-1] / 2)])
