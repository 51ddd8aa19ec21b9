"""Features paired with modes: which belongs to which, and the four numbers by least squares once that is known.

    ln λ_i = ln γ + ln λ̂_j,   d_i = ½(α + βλ_i),   ln a_i = ln σ + ln |â_j|,   λ_i = ω_i² + d_i²
        [Ren, Yeh, Lin 2013, eq. 6, 10-12]

The first and third are means, the second a straight line with neither number below its bound. Each residual counts by
its feature's spread and by the misfit all of them share (a mesh's error, a merged pair), and one far out counts by its
distance, not its square [Huber 1964]. Where everything fits, the answer is exact to rounding, whatever the weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from sonic_bullet.lab.lines.line_values import Features, energy
from sonic_bullet.records import Array
from studies.ren2013.hybrid.matching import Points, match_ratio_product
from studies.ren2013.problem import Problem, modes_of
from studies.ren2013.search_metric import Aim
from studies.ren2013.starts import by_energy, feature_eigenvalues, undominated

STRONGEST = 12  # features that are paired with modes to guess γ
APART = 3e-3  # of ln γ: guesses closer than this are one guess
DISTINCT = 0.01  # of ln γ: starts closer than this end in one minimum
UNDOMINATED = 12
ROUNDS = 12
REWEIGHTED = 12
HUBER = 1.345


def _relative(spread: Array, value: Array) -> Array:
    sound = np.isfinite(spread) & (spread > 0)
    return np.where(sound, spread / value, np.median((spread / value)[sound]) if sound.any() else 1e-9)


@njit(nogil=True, error_model="numpy")
def _mean(value, spread, trust):  # type: ignore[no-untyped-def]
    """Robust mean of (k,) values and the misfit beyond their spreads."""
    middle = np.median(value)
    misfit = 1.4826 * np.median(np.abs(value - middle))
    scale = np.maximum(np.hypot(spread, misfit), 1e-15)
    for _ in range(REWEIGHTED):
        weight = trust * np.minimum(1.0, HUBER * scale / np.maximum(np.abs(value - middle), 1e-300)) / scale**2
        middle = (weight * value).sum() / weight.sum()
    return middle, misfit


def rayleigh(features: Features, trust: Array, lower: Array, upper: Array) -> tuple[float, float]:
    """α, β of d = ½(α + βλ) through all features (k,), trust (k,) a weight each, within bounds."""
    decay = np.maximum(features.decay_per_s, 1e-6)
    alpha, beta = _rayleigh(feature_eigenvalues(features), decay, _relative(features.decay_sd_per_s, decay), trust)
    return float(np.clip(alpha, lower[0], upper[0])), float(np.clip(beta, lower[1], upper[1]))


@njit(nogil=True, error_model="numpy")
def _rayleigh(eigen, decay, spread, trust):  # type: ignore[no-untyped-def]
    """Robust non-negative α, β; spread (k,) relative. The misfit shared by all starts at all of it and shrinks to
    what is left.
    """
    unit = np.median(eigen)
    alpha, beta, misfit = 2 * np.median(decay), 0.0, 1.0
    for _ in range(REWEIGHTED):
        fitted = np.maximum(0.5 * (alpha + beta * eigen / unit), 1e-9)
        off = decay - fitted
        scale = np.maximum(np.hypot(spread, misfit) * fitted, 1e-12 * fitted)
        weight = trust * np.minimum(1.0, HUBER * scale / np.maximum(np.abs(off), 1e-300)) / scale**2
        first, second = 0.5, 0.5 * eigen / unit
        a, b, c = (weight * first**2).sum(), (weight * first * second).sum(), (weight * second**2).sum()
        p, q = (weight * first * decay).sum(), (weight * second * decay).sum()
        determinant = a * c - b * b
        alpha, beta = (c * p - b * q) / determinant, (a * q - b * p) / determinant
        if not (determinant > 1e-14 * a * c and alpha >= 0 and beta >= 0):
            alone_alpha, alone_beta = p / a, q / c
            alpha, beta = (alone_alpha, 0.0) if alone_alpha * p > alone_beta * q else (0.0, alone_beta)
        misfit = max(
            1.4826 * np.median(np.abs(decay / np.maximum(0.5 * (alpha + beta * eigen / unit), 1e-9) - 1)), 1e-9
        )
    return alpha, beta / unit


def partners(problem: Problem, parameters: Array, tolerance: float) -> tuple[Array, Array]:
    """For each feature the mode that fits it best, (k,) indices, and whether λ lies within e^±tolerance of it, (k,)
    bool.

    A mode goes to one feature, the best served. Far off in loudness costs as being off in λ does: a factor e is half
    the tolerance.
    """
    eigen = np.log(feature_eigenvalues(problem.features))
    freq_hz, _, amplitude = modes_of(parameters, problem.lambda_hat, problem.amplitude_hat)
    size = np.abs(amplitude)
    sounds = (freq_hz > 0) & (size > 0)
    off_eigen = np.abs(eigen[:, None] - np.log(parameters[2] * problem.lambda_hat)[None])
    off_size = np.abs(np.log(problem.features.amplitude)[:, None] - np.log(np.where(sounds, size, 1.0))[None])
    cost = np.where(sounds[None], off_eigen / tolerance + 0.5 * np.minimum(off_size, 6.0), np.inf)
    mode = np.argmin(cost, axis=1)
    least = cost[np.arange(len(mode)), mode]
    best = np.full(len(freq_hz), np.inf)
    np.minimum.at(best, mode, least)
    return mode, (off_eigen[np.arange(len(mode)), mode] < tolerance) & (least <= best[mode])


def all_partners(problem: Problem, start: Array) -> Array:
    """(4,) α, β, γ, σ by least squares from a start near enough that features find their modes."""
    features = problem.features
    alpha, beta, gamma, sigma = start
    eigen = np.log(feature_eigenvalues(features))
    eigen_spread = 2 * _relative(features.freq_sd_hz, features.freq_hz)
    size_spread = _relative(features.amplitude_sd, features.amplitude)
    trust = np.sqrt(energy(features.decay_per_s, features.amplitude))
    trust = np.maximum(trust / trust.max(), 1e-3)
    tolerance = 0.03
    matched = np.zeros(len(eigen), bool)
    for _ in range(ROUNDS):
        mode, now = partners(problem, np.array([alpha, beta, gamma, sigma]), tolerance)
        if not now.any():
            break
        log_gamma, misfit = _mean((eigen - np.log(problem.lambda_hat[mode]))[now], eigen_spread[now], trust[now])
        log_sigma, _ = _mean(
            np.log(features.amplitude[now]) - np.log(np.abs(problem.amplitude_hat[mode[now]])),
            size_spread[now],
            trust[now],
        )
        still = abs(log_gamma - np.log(gamma)) < 1e-12 and (now == matched).all()
        gamma, sigma, matched = np.exp(log_gamma), np.exp(log_sigma), now
        alpha, beta = rayleigh(_only(features, now), trust[now], problem.lower, problem.upper)
        if still:
            break
        tolerance = float(np.clip(4 * misfit, 2e-3, 0.03))
    return np.asarray(np.clip([alpha, beta, gamma, sigma], problem.lower, problem.upper))


def _only(features: Features, which: Array) -> Features:
    return Features(
        freq_hz=features.freq_hz[which],
        decay_per_s=features.decay_per_s[which],
        amplitude=features.amplitude[which],
        phase_rad=features.phase_rad[which],
        freq_sd_hz=features.freq_sd_hz[which],
        decay_sd_per_s=features.decay_sd_per_s[which],
        amplitude_sd=features.amplitude_sd[which],
        onset_s=features.onset_s,
        noise_dbfs=features.noise_dbfs,
        sr=features.sr,
    )


def candidates(aim: Aim, most: int) -> Array:
    """(s, 4) starts: every strong feature on every audible mode gives a γ; alike ones are one; Π_MRP keeps the best
    ``most``.

    The paper's own γ's, each undominated mode on the most dominant feature, come with them: one of those is always near
    [section 5.3].
    """
    problem, features = aim.problem, aim.problem.features
    strong = by_energy(features)[:STRONGEST]
    size = np.abs(problem.amplitude_hat)
    audible = np.flatnonzero(size > 1e-3 * size.max())
    eigen = feature_eigenvalues(features)
    alpha, beta = rayleigh(features, np.ones(len(eigen)), problem.lower, problem.upper)
    guess = np.sort((np.log(eigen[strong])[:, None] - np.log(problem.lambda_hat[audible])[None]).ravel())
    guess = guess[(guess >= np.log(problem.lower[2])) & (guess <= np.log(problem.upper[2]))]
    if not len(guess):
        guess = np.log(np.clip(eigen[strong[:1]] / problem.lambda_hat[audible[:1]], problem.lower[2], problem.upper[2]))
    group = np.concatenate([[0], np.cumsum(np.diff(guess) > APART)])
    guess = np.bincount(group, guess) / np.bincount(group)
    score = best_pairs(aim.target.points, problem.lambda_hat, problem.amplitude_hat, alpha, beta, np.exp(guess))
    surest = np.log(
        eigen[strong[0]] / problem.lambda_hat[undominated(problem.lambda_hat, problem.amplitude_hat)[-UNDOMINATED:]]
    )
    kept: list[float] = []
    for log_gamma in (
        *guess[np.argsort(score, kind="stable")],
        *np.clip(surest, *np.log([problem.lower[2], problem.upper[2]])),
    ):
        # the last ones come whatever Π_MRP says of them: where few of many modes were observed it likes a γ that hides
        # the rest under those
        if (len(kept) < most or log_gamma in surest) and all(abs(log_gamma - other) > DISTINCT for other in kept):
            kept.append(float(log_gamma))
    rows = []
    for gamma in np.exp(kept):
        freq_hz, decay, amplitude = modes_of(
            np.array([alpha, beta, gamma, 1.0]), problem.lambda_hat, problem.amplitude_hat
        )
        observed = (freq_hz > 0) & (freq_hz < features.sr / 2)
        total = energy(decay, amplitude)[observed].sum()
        sigma = (
            np.sqrt(energy(features.decay_per_s, features.amplitude).sum() / total)
            if total > 0
            else problem.features.amplitude.max() / size.max()
        )
        rows.append((alpha, beta, gamma, sigma))
    return np.asarray(np.clip(np.array(rows), problem.lower, problem.upper))


def best_pairs(
    reference: Points, lambda_hat: Array, amplitude_hat: Array, alpha_per_s: float, beta_s: float, gamma_m2_s2: Array
) -> Array:
    """(g,) Π_MRP at each γ with α, β held."""
    return np.array(
        [
            match_ratio_product(reference, *modes_of(parameters, lambda_hat, amplitude_hat))
            for parameters in (np.array([alpha_per_s, beta_s, gamma, 1.0]) for gamma in gamma_m2_s2)
        ]
    )
