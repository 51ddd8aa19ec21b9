"""Two searches for α, β, γ, σ: the paper's, kept as the yardstick, and one that spends its evaluations where they tell.

reference   every start of `seed_starts` walked down Π by Nelder and Mead in the logarithms, the best wins
    [Ren, Yeh, Lin 2013, section 5.3]
fast
    1. Π_MRP alone (some tens of µs, blind to σ) sifts γ's from laying every feature on every mode; α, β from all
    features at once
            2. the best few are matched feature to mode and solved as least squares, each residual by its spread
                (partners.py); Π ranks them
            3. the best is walked down Π, a sum of squares, by Levenberg and Marquardt, then by Newton's method

What the features say is kept where Π below it says that the images agree (EXACT): there they know better.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from sonic_bullet.records import Array
from studies.ren2013.hybrid.metric import Constants
from studies.ren2013.partners import all_partners, candidates
from studies.ren2013.problem import Found, Problem
from studies.ren2013.search_metric import Aim, aim_at, hybrid, residuals
from studies.ren2013.starts import feature_eigenvalues, seed_starts

# first simplex, in the logarithms: what the paper's source of the method does [Lagarias et al. 1999; MATLAB's
# fminsearch]
STEP = 0.05
STEP_TOLERANCE = 1e-4  # section 7, below Table II
METRIC_TOLERANCE = 1e-8
EXACT = 1e-5  # a third of a percent of the image, rms; an onset found one sample late costs a tenth of that
MOST = 2000
SIFTED = 6
POLISH_ROUNDS = 3
GAIN = 1e-4  # of Π: least squares stop where a step brings less
SETTLE = 1e-4  # one unit of the last search raises Π by this part of it
SETTLE_ROUNDS = 30
POLISH_TOLERANCE = 1e-12
WIDTH = np.array([1e-2, 1e-2, 1e-4, 1e-2])  # of the differences that stand for slopes, in the logarithms


class _Counted:
    """Π over the logarithms, kept in bounds, counting its calls."""

    def __init__(self, aim: Aim) -> None:
        self.aim, self.calls = aim, 0
        self.low, self.high = np.log(aim.problem.lower), np.log(aim.problem.upper)

    def __call__(self, logs: Array) -> float:
        self.calls += 1
        inside = np.clip(logs, self.low, self.high)
        return hybrid(self.aim, np.exp(inside)) + float(((logs - inside) ** 2).sum())


def _walk(function: Callable[[Array], float], start: Array, step: Array) -> tuple[Array, float]:
    from scipy.optimize import minimize

    simplex = np.vstack([start, start + np.diag(step)])
    options = {"xatol": STEP_TOLERANCE, "fatol": METRIC_TOLERANCE, "maxfev": MOST, "initial_simplex": simplex}
    result = minimize(function, start, method="Nelder-Mead", options=options)
    return np.asarray(result.x), float(result.fun)


def _found(aim: Aim, logs: Array, metric: float, evaluations: int, begun: float, starts: int) -> Found:
    alpha, beta, gamma, sigma = (float(value) for value in np.clip(np.exp(logs), aim.problem.lower, aim.problem.upper))
    return Found(alpha, beta, gamma, sigma, float(metric), evaluations, time.perf_counter() - begun, starts)


def reference(problem: Problem, constants: Constants | None = None) -> Found:
    """The paper's optimiser [section 5.3].

    Raises RecordError where the recording is too short or too quiet for an image.
    """
    begun = time.perf_counter()
    aim = aim_at(problem, constants)
    count = _Counted(aim)
    starts = np.log(seed_starts(problem))
    ends = [_walk(count, start, np.full(4, STEP)) for start in starts]
    logs, metric = min(ends, key=lambda end: end[1])
    return _found(aim, logs, metric, count.calls, begun, len(starts))


def fast(problem: Problem, constants: Constants | None = None) -> Found:
    """The same minimum for less. evaluations counts Π and images, not Π_MRP alone. Raises as `reference` does."""
    begun = time.perf_counter()
    aim = aim_at(problem, constants)
    count = _Counted(aim)
    rough = candidates(aim, SIFTED)
    solved = np.array([all_partners(problem, start) for start in rough])
    starts = np.unique(np.vstack([solved, rough]), axis=0)
    metric, logs = min(((count(start), start) for start in np.log(starts)), key=lambda end: end[0])
    if metric > EXACT:
        metric, logs = min((metric, logs), _polish(aim, count, logs), key=lambda end: end[0])
    return _found(aim, logs, metric, count.calls, begun, len(starts))


def polish(problem: Problem, start: Array, constants: Constants | None = None) -> Found:
    """Down Π from one start α, β, γ, σ (4,): the last of the fast search's three steps. Raises as `reference` does."""
    begun = time.perf_counter()
    aim = aim_at(problem, constants)
    count = _Counted(aim)
    metric, logs = _polish(aim, count, np.log(np.clip(start, problem.lower, problem.upper)))
    return _found(aim, logs, metric, count.calls, begun, 1)


def _polish(aim: Aim, count: _Counted, start: Array) -> tuple[float, Array]:
    """Π as the sum of squares it is, by Levenberg and Marquardt with Broyden's slopes; then by Newton in axes along
    which Π rises alike.

    α and β enter the logarithm with a tenth of the typical decay added, so that one too small to be heard is no long
    flat valley.
    """
    problem = aim.problem
    decay = 0.1 * float(np.median(problem.features.decay_per_s))
    shift = np.array([decay, decay / float(np.median(feature_eigenvalues(problem.features))), 0.0, 0.0])
    low, high = np.log(problem.lower + shift), np.log(problem.upper + shift)

    def values(at: Array) -> Array:
        return np.asarray(np.clip(np.exp(np.clip(at, low, high)) - shift, problem.lower, problem.upper))

    def look(at: Array) -> tuple[float, Array]:
        count.calls += 1
        seen = residuals(aim, values(at))
        return float(seen @ seen), seen

    place, damping = np.log(np.exp(start) + shift), 1e-3
    metric, seen = look(place)
    for _ in range(POLISH_ROUNDS):
        slope = np.stack([(look(place + WIDTH * unit)[1] - seen) / (WIDTH @ unit) for unit in np.eye(4)])
        before = metric
        while damping < 1e4:
            normal = slope @ slope.T
            normal += 1e-9 * np.trace(normal) * np.eye(4)
            step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -slope @ seen)
            trial = np.clip(place + np.clip(step, -0.5, 0.5), low, high)
            tried, there = look(trial)
            went = trial - place
            if went @ went > 0:  # Broyden's secant: the next step needs no new slopes
                slope += np.outer(went / (went @ went), there - seen - went @ slope)
            if tried < metric:
                gain = 1 - tried / metric
                metric, place, seen, damping = tried, trial, there, damping / 10
                if gain < GAIN:
                    break
            else:
                damping *= 30
        if 1 - metric / before < 10 * GAIN:
            break
        damping = 1e-3
    normal = slope @ slope.T + 1e-9 * float((slope**2).sum()) * np.eye(4)
    axes = np.linalg.inv(np.linalg.cholesky(normal)).T * np.sqrt(SETTLE * metric)
    metric, end = _settle(lambda u: count(np.log(values(place + axes @ u))), metric)
    return metric, np.log(values(place + axes @ end))


def _settle(function: Callable[[Array], float], here: float) -> tuple[float, Array]:
    """Newton's method from 0 on a function of four numbers that is about here + Σu² near it, by differences: value and
    place.
    """
    place, reach = np.zeros(4), 1.0
    unit = np.eye(4)
    cross: Array = np.zeros((4, 4))
    for turn in range(SETTLE_ROUNDS):
        ahead, behind = (np.array([function(place + sign * reach * e) for e in unit]) for sign in (1, -1))
        bend = (ahead + behind - 2 * here) / reach**2
        if turn == 0:
            for i in range(4):
                for j in range(i):
                    both = function(place + reach * (unit[i] + unit[j]))
                    cross[i, j] = cross[j, i] = (both - ahead[i] - ahead[j] + here) / reach**2
        size, axis = np.linalg.eigh(cross + np.diag(bend))
        slope = (ahead - behind) / (2 * reach)
        step = -axis @ ((axis.T @ slope) / np.maximum(np.abs(size), 1e-3 * np.abs(size).max()))
        tries = [place + step * min(1.0, 50 / max(float(np.linalg.norm(step)), 1e-12))]
        found = min(
            [(function(tries[0]), tries[0])]
            + [
                (float(value), place + sign * reach * e)
                for sign, values in ((1, ahead), (-1, behind))
                for value, e in zip(values, unit, strict=True)
            ],
            key=lambda end: end[0],
        )
        if found[0] >= here:
            if reach < 0.05:
                break
            reach /= 5
            continue
        gain, here, place = here - found[0], *found
        if gain < POLISH_TOLERANCE:
            break
        reach = max(reach / 2, 0.1)
    return here, place
