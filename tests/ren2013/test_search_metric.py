"""The hybrid metric over α, β, γ, σ: the ratio it says it is, and the sum of squares that a search wants."""

from __future__ import annotations

import numpy as np
import pytest

from studies.ren2013.hybrid.image import distance
from studies.ren2013.problem import Problem, modes_of
from studies.ren2013.search_metric import aim_at, hybrid, match, residuals
from tests.ren2013.test_metric import observed, sounding

pytestmark = pytest.mark.slow  # as that file


def test_hybrid_is_the_ratio_and_the_sum_of_squares() -> None:
    lambda_hat = (2 * np.pi * np.linspace(300, 9000, 12)) ** 2
    amplitude_hat = np.cos(np.arange(12.0))
    truth = np.array([20.0, 1e-7, 1.0, 0.1])
    modes = modes_of(truth, lambda_hat, amplitude_hat)
    aim = aim_at(Problem(observed(*modes), sounding(*modes), lambda_hat, amplitude_hat))
    assert hybrid(aim, truth) < 1e-8
    away = truth * np.array([1.5, 0.8, 1.02, 1.3])
    there = modes_of(away, lambda_hat, amplitude_hat)
    assert hybrid(aim, away) == pytest.approx(distance(aim.target.image, *there) / -match(aim, away), rel=1e-12)
    assert hybrid(aim, away) == pytest.approx(float((residuals(aim, away) ** 2).sum()), rel=1e-9)
    assert hybrid(aim, away) == pytest.approx(hybrid(aim, away, plain=True), rel=1e-5)
