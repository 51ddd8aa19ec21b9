"""Where a search for α, β, γ, σ begins.

    d_i = ½(α + βλ_i),  λ_i = ω_i² + d_i²       two features make a circle: β = 2(d₁ − d₂)/(λ₁ − λ₂), α = 2d₁ − βλ₁
    γ = λ₁/λ̂_j,  σ = a₁/|â_j|                    one mode placed on the most dominant feature
        [Ren, Yeh, Lin 2013, eq. 8, section 5.3]

The paper draws pairs from N_dominant features (its Table II counts ten pairs a mode, so five) and modes no other
undoes: none of lower λ̂ has a larger |â|. A pair whose circle has α or β below its bound is moved to the bound, the
other fitted to the stronger feature of the two.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from sonic_bullet.lab.lines.line_values import Features, energy
from sonic_bullet.records import Array
from studies.ren2013.problem import Problem

DOMINANT = 5


def feature_eigenvalues(features: Features) -> Array:
    """(k,) λ = ω² + d² in 1/s² of what was observed. Source: eq. 6, 7."""
    return np.asarray((2 * np.pi * features.freq_hz) ** 2 + features.decay_per_s**2)


def by_energy(features: Features) -> Array:
    """(k,) indices, the most energetic first."""
    return np.argsort(-energy(features.decay_per_s, features.amplitude), kind="stable")


def circle(features: Features, first: int, second: int, lower: Array, upper: Array) -> tuple[float, float]:
    """α, β of the Rayleigh circle through two features, ``first`` the stronger one, kept within bounds.

    Source: eq. 8.
    """
    eigen, decay = feature_eigenvalues(features)[[first, second]], features.decay_per_s[[first, second]]
    beta = 2 * (decay[0] - decay[1]) / (eigen[0] - eigen[1]) if eigen[0] != eigen[1] else 0.0
    alpha = 2 * decay[0] - beta * eigen[0]
    if alpha < lower[0]:
        beta = 2 * decay[0] / eigen[0]
    if beta < lower[1]:
        alpha = 2 * decay[0]
    return float(np.clip(alpha, lower[0], upper[0])), float(np.clip(beta, lower[1], upper[1]))


def undominated(lambda_hat: Array, amplitude_hat: Array) -> Array:
    """Indices of the modes such that none of lower λ̂ has a larger |â| [section 5.3], by rising λ̂."""
    order = np.argsort(lambda_hat, kind="stable")
    size = np.abs(amplitude_hat[order])
    return np.asarray(order[(size >= np.maximum.accumulate(size)) & (size > 0)])


def seed_starts(problem: Problem, dominant: int = DOMINANT) -> Array:
    """(s, 4) the paper's starting points α, β, γ, σ."""
    strong = by_energy(problem.features)[:dominant]
    pairs = list(combinations(strong, 2)) or [(strong[0], strong[0])]
    eigen = feature_eigenvalues(problem.features)[strong[0]]
    modes = undominated(problem.lambda_hat, problem.amplitude_hat)
    rows = [
        (
            *circle(problem.features, first, second, problem.lower, problem.upper),
            eigen / problem.lambda_hat[j],
            problem.features.amplitude[strong[0]] / abs(problem.amplitude_hat[j]),
        )
        for first, second in pairs
        for j in modes
    ]
    return np.asarray(np.clip(np.array(rows), problem.lower, problem.upper))
