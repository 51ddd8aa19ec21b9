"""Lines -> α and β, by least squares that notices where the law does not hold.

d = ½(α + βλ), λ = ω² + d²                                                            [Ren, Yeh, Lin 2013, eq. 6-8]
Σ w (d − ½α − ½βλ)² → min,  w = c/(s² + (τd)²),
    τ: the least relative scatter that makes the residuals as large as their spreads [Paule & Mandel 1982],
    c: Cauchy's weight of outliers
Where that τ is large, it may be a few lines that obey no law (clicks, other bodies' modes, fixtures): values then come
with the τ of which half of the lines fall within their spreads, reached from above [least median of squares: Rousseeuw
1984].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.robust import cauchy_weight


@dataclass(frozen=True, slots=True, eq=False)
class RayleighFit:
    """α and β with what is known of them.

    covariance (2, 2): of their logarithms, NaN where the lines do not say; scatter: τ of all lines; said: what is not
    identifiable.
    """

    alpha_per_s: float
    beta_s: float
    covariance: Array
    scatter: float
    said: tuple[str, ...]


def rayleigh(
    lambda_per_s2: Array,
    decay_per_s: Array,
    decay_sd_per_s: Array,
    guess: tuple[float, float],
    whole_per_s: Array | None = None,
) -> RayleighFit:
    """Fit α and β to lines (k,).

    guess: (α, β) whose ratio stands in for what one line cannot tell. A spread that is infinite: no value; NaN: 5 %.
    whole_per_s (k,): what was measured, where decays are what something else has left of it: scatter is relative to
    that, or what is hardly there would be sure. What is left may then be below zero: leaving that out would bend the
    law upwards.
    """
    standard_errors = 0.5  # a parameter whose logarithm is surer than this is identified by the lines
    good = (
        np.isfinite(decay_per_s)
        & ((decay_per_s if whole_per_s is None else whole_per_s) > 0)
        & ~np.isposinf(decay_sd_per_s)
    )
    lam, decay = lambda_per_s2[good], decay_per_s[good]
    size = decay if whole_per_s is None else whole_per_s[good]
    spread = np.where(np.isfinite(decay_sd_per_s[good]), decay_sd_per_s[good], 0.05 * size)
    unknown = np.full((2, 2), np.nan)
    if len(lam) == 0:
        return RayleighFit(*guess, unknown, np.nan, ("alpha", "beta"))
    if len(lam) == 1 or np.ptp(np.log(lam)) < 0.05:
        weight = spread**-2
        share = 0.5 * (guess[0] + guess[1] * lam)
        scale = float((weight * decay * share).sum() / (weight * share**2).sum())
        return RayleighFit(scale * guess[0], scale * guess[1], unknown, np.nan, ("alpha", "beta"))
    value, information, scatter = _fit_scatter(lam, decay, np.maximum(spread, 1e-6 * size), size)
    said = []
    with np.errstate(divide="ignore", invalid="ignore"):
        covariance = np.linalg.inv(information) / np.outer(value, value)
        for i, name in enumerate(("alpha", "beta")):
            if not (value[i] > 0 and 0 <= covariance[i, i] < standard_errors**2):
                said.append(name)
                covariance[i, :] = covariance[:, i] = np.nan
    return RayleighFit(float(value[0]), float(value[1]), covariance, scatter, tuple(said))


def _fit_scatter(lam: Array, decay: Array, spread: Array, size: Array) -> tuple[Array, Array, float]:
    """Values, information, τ, which is relative to size (k,)."""
    freedom = max(len(lam) - 2, 1)

    def at(tau: float) -> tuple[Array, Array, float]:
        value, information, chi, _, _ = _fit_weighted(lam, decay, np.hypot(spread, tau * size))
        return value, information, chi - freedom

    low, high = 0.0, 3.0
    best = at(low)
    if len(lam) == 2 or best[2] <= 2 * np.sqrt(2 * freedom):  # the law holds as far as can be identified
        return best[0], best[1] / max(1.0, best[2] / freedom + 1), 0.0
    for _ in range(40):
        middle = (low + high) / 2
        best = at(middle)
        low, high = (middle, high) if best[2] > 0 else (low, middle)
    return *_by_most(lam, decay, spread, size, freedom, high), high


def _by_most(lam: Array, decay: Array, spread: Array, size: Array, freedom: int, scatter: float) -> tuple[Array, Array]:
    """Return values and information that most of the lines agree on; of few lines, all at their scatter.

    Squares relative to what was measured cost a law that says nothing one a line at most: a line that rings far too
    long holds the law down. So where a law through two lines is nearer to all, by their logarithms, it begins there.
    """
    least_many = 8  # lines of which half identify a law
    least_few = 5  # of which one may be another's: four then agree on two numbers

    def end(tau: float, weight: Array) -> tuple[Array, Array]:
        if len(lam) < least_many:
            return _fit_weighted(lam, decay, np.hypot(spread, tau * size), weight)[:2]
        return _descend_scatter(lam, decay, spread, size, freedom, tau, weight)

    best = end(scatter if len(lam) < least_many else 1.0, np.ones(len(lam)))
    law, off = _through_two(lam, decay, size)
    if len(lam) < least_few or _log_off(law, lam, decay, size) >= _log_off(best[0], lam, decay, size):
        return best
    return end(off, cauchy_weight(((decay - 0.5 * (law[0] + law[1] * lam)) / np.hypot(spread, off * size) / 3.0) ** 2))


def _through_two(lam: Array, decay: Array, size: Array) -> tuple[Array, float]:
    """Return of the laws through two lines the one nearest to most of them, and how far that is.

    Elemental sets [Rousseeuw 1984, sec. 5].
    """
    i, j = np.triu_indices(len(lam), 1)
    apart = np.abs(np.log(lam[i] / lam[j])) > 0.05
    i, j = i[apart], j[apart]
    beta = 2 * (decay[i] - decay[j]) / (lam[i] - lam[j])
    law = np.stack([2 * decay[i] - beta * lam[i], beta])
    law = law[:, (law >= 0).all(axis=0)]
    if not law.size:
        return np.zeros(2), np.inf
    off = np.median(np.abs(decay - 0.5 * (law[0, :, None] + law[1, :, None] * lam)) / size, axis=-1)
    return law[:, int(off.argmin())], float(off.min())


def _log_off(law: Array, lam: Array, decay: Array, size: Array) -> float:
    """Return what a law (2,) is off by: the mean, over lines, of |ln| of what it makes of them over their size (k,)."""
    return float(np.abs(np.log(np.maximum(size - decay + 0.5 * (law[0] + law[1] * lam), 1e-9 * size) / size)).mean())


def _descend_scatter(
    lam: Array, decay: Array, spread: Array, size: Array, freedom: int, tau: float, weight: Array
) -> tuple[Array, Array]:
    """Return values and information at the least τ of which half of the lines fall within their spreads.

    From a relative scatter τ and weights (k,) on downwards.
    """
    half = 0.4549  # median of χ² with one degree of freedom
    value, information, _, weight, _ = _fit_weighted(lam, decay, np.hypot(spread, tau * size), weight)
    while tau > 1e-5:
        tau *= 0.8
        trial = _fit_weighted(lam, decay, np.hypot(spread, tau * size), weight)
        if np.median(trial[4]) > half * freedom / len(lam):
            break
        value, information, _, weight, _ = trial
    return value, information


def _fit_weighted(
    lam: Array, decay: Array, sd: Array, start: Array | None = None
) -> tuple[Array, Array, float, Array, Array]:
    """Return values (2,) >= 0, information (2, 2), Σ of squared residuals cut at 9, outliers' weights, squares (k,)."""
    slope = np.stack([np.full(len(lam), 0.5), 0.5 * lam], axis=1) / sd[:, None]
    scale = 1 / np.sqrt((slope**2).sum(axis=0))
    weight = np.ones(len(lam)) if start is None else start
    value = np.zeros(2)
    for _ in range(20):
        a = slope * scale * np.sqrt(weight)[:, None]
        value = _not_negative(a, decay / sd * np.sqrt(weight))
        residual = decay / sd - slope @ (value * scale)
        weight = cauchy_weight((residual / 3.0) ** 2) if len(lam) > 3 else weight
    value = value * scale
    return value, (slope * weight[:, None]).T @ slope, float(np.minimum(residual**2, 9.0).sum()), weight, residual**2


def _not_negative(a: Array, b: Array) -> Array:
    """Return x (2,) >= 0 of least |a x − b|: inside, or the better one of the two edges."""
    gram, right = a.T @ a, a.T @ b
    own = np.diag(gram)
    det = own[0] * own[1] - gram[0, 1] ** 2
    if det > 1e-14 * own[0] * own[1]:
        both = np.array([own[1] * right[0] - gram[0, 1] * right[1], own[0] * right[1] - gram[0, 1] * right[0]]) / det
        if (both >= 0).all():
            return np.asarray(both)
    edge = np.maximum(right, 0.0) / np.maximum(own, 1e-300)
    return np.asarray(np.where(np.arange(2) == int(np.argmax(edge * right)), edge, 0.0))
