"""What the error of a mesh's dimensions adds to the spread of γ = E/ρ.

A free solid of one scale L: f ∝ √γ / L, so γ = (L f)² · const, and at measured f
    d ln γ = 2 d ln L                     var ln γ = var of the lines + (2t)²,   t the relative standard error of L

A bar in bending alone, ρ given: E = 0.9465 (m f²/b)(L/h)³ T, m = ρ b h L, so γ ∝ f² L⁴/h²: an error of the thickness
alone counts twice, too, one of the length alone four times.          [ASTM E1876-22, eq. 1 and its error propagation]

Errors of several objects measured by one person with one tool do not average out: the largest counts. Poisson's ratio
comes from ratios of frequencies, which one scale leaves as they are.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.estimator.fit.case_fit import ObjectFit
from sonic_bullet.records import Array

GAMMA_PER_SCALE = 2.0  # d ln γ / d ln L


def scale_tolerance(objects: tuple[ObjectFit, ...]) -> float:
    """Return the relative standard error of the dimensions behind γ: of the objects that have lines, the largest."""
    return max((o.evidence.thing.dimension_tolerance for o in objects if (o.line >= 0).any()), default=0.0)


def add_dimension_tolerance(covariance: Array, tolerance: float) -> None:
    """Add what dimensions known to a relative tolerance bring to the variance of ln γ, row and column 2, in place.

    A variance of NaN, where γ is not identifiable, stays NaN.
    """
    covariance[2, 2] += (GAMMA_PER_SCALE * tolerance) ** 2


def lines_sd(covariance: Array, tolerance: float) -> float:
    """Return the spread of ln γ that the lines alone leave."""
    return float(np.sqrt(max(covariance[2, 2] - (GAMMA_PER_SCALE * tolerance) ** 2, 0.0)))
