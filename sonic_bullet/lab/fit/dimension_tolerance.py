"""What the error of a mesh's dimensions adds to the spread of γ = E/ρ.

A free solid of one scale L: f ∝ √γ / L, so γ = (L f)² · const, and at measured f
    d ln γ = 2 d ln L                     var ln γ = var of the lines + (2t)²,   t the relative standard error of L

A bar in bending alone, ρ given: E = 0.9465 (m f²/b)(L/h)³ T, m = ρ b h L, so γ ∝ f² L⁴/h²: an error of the thickness
alone counts twice, too, one of the length alone four times.          [ASTM E1876-22, eq. 1 and its error propagation]

Errors of several objects measured by one person with one tool do not average out: the largest counts. Poisson's ratio
comes from ratios of frequencies, which one scale leaves as they are, but the error of a single dimension does not.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.lab.fit.case_fit import ObjectFit
from sonic_bullet.lab.fit.pairing import Pairs, group_modes, known_to, learnt_mesh_sd, solve
from sonic_bullet.lab.fit.recorded import RecordedObject
from sonic_bullet.modal.isotropic_family import stretch_slopes
from sonic_bullet.records import Array

GAMMA_PER_SCALE = 2.0  # d ln γ / d ln L


def scale_tolerance(objects: tuple[ObjectFit, ...]) -> float:
    """Return the relative standard error of the dimensions behind γ: of the objects that have lines, the largest."""
    return max((o.evidence.thing.dimension_tolerance for o in objects if (o.line >= 0).any()), default=0.0)


def poisson_sd_of_dimensions(shaped: tuple[RecordedObject, ...], pairs: tuple[Pairs, ...], scatter: float) -> float:
    """Return the standard error of ν that the dimensions of the shapes bring, each wrong on its own.

    Wrong by t along a: every ln λ of the model is off by s_a t, and the least squares of the lines answer with
    δ(ln γ, ν) = −(XᵀWX)⁻¹ XᵀW s_a t. Three axes in quadrature; objects add up, as their errors are one tool's.

    scatter: of frequencies, what the lines' weights rest on. 0 where lines do not tell ν.
    """
    count = sum(len(p.line) for p in pairs)
    information, pulls = np.zeros((2, 2)), []
    for e, p in zip(shaped, pairs, strict=True):
        if e.family is None or e.seen is None or not len(p.line):
            continue
        group, mesh_sd = group_modes(e.family, e.seen, p.log_gamma, p.poisson), learnt_mesh_sd(scatter, count)
        _, own, weight = solve(e.lines, group, p.line, p.mode, 0.0, 1e6, mesh_sd)
        information += own
        if not e.thing.dimension_tolerance:
            continue
        moved = stretch_slopes(e.family, p.poisson)
        moved = np.array([moved[who].mean(axis=0) for who in group.member])[p.mode]
        slope = np.stack([np.ones(len(p.line)), group.slope[p.mode]], axis=1)
        each = weight / known_to(e.lines, p.line, mesh_sd) ** 2
        pulls.append(e.thing.dimension_tolerance * (slope * each[:, None]).T @ moved)
    if not pulls or not np.linalg.det(information) > 1e-12 * information[0, 0] * information[1, 1]:
        return 0.0
    return float(sum(np.linalg.norm(np.linalg.solve(information, pull)[1]) for pull in pulls))


def add_dimension_tolerance(covariance: Array, tolerance: float, poisson_sd: float) -> None:
    """Add what dimensions known to a relative tolerance bring to the variances of ln γ and ν, in place.

    poisson_sd: what they bring to ν. A variance of NaN, where a parameter is not identifiable, stays NaN.
    """
    covariance[2, 2] += (GAMMA_PER_SCALE * tolerance) ** 2
    covariance[4, 4] += poisson_sd**2


def lines_sd(covariance: Array, tolerance: float) -> float:
    """Return the spread of ln γ that the lines alone leave."""
    return float(np.sqrt(max(covariance[2, 2] - (GAMMA_PER_SCALE * tolerance) ** 2, 0.0)))
