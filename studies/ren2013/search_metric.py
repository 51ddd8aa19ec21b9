"""The hybrid metric as a function of α, β, γ, σ: what the searches walk down.

Π(α, β, γ, σ) = Π of the modes that the four numbers make                          [Ren, Yeh, Lin 2013, eq. 27]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from studies.ren2013.hybrid.image import distance
from studies.ren2013.hybrid.matching import match_ratio_product
from studies.ren2013.hybrid.metric import Constants, Target, hybrid_of_modes, match_of_modes, target
from studies.ren2013.plain_image import plain_distance
from studies.ren2013.problem import Problem, modes_of


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """A problem, and its recording's image and points worked out once."""

    problem: Problem
    target: Target


def aim_at(problem: Problem, constants: Constants | None = None) -> Aim:
    """Raises RecordError where the recording is too short or too quiet for an image."""
    level = problem.full_scale_db_spl
    return Aim(problem, target(problem.features, problem.signal, full_scale_db_spl=level, constants=constants))


def hybrid(aim: Aim, parameters: Array, *, plain: bool = False) -> float:
    """Π at α, β, γ, σ (4,). plain: the image by synthesis and Fourier transforms instead of in closed form."""
    modes = _modes(aim, parameters)
    if plain:
        return plain_distance(aim.target.image, *modes) / match_of_modes(aim.target, *modes)
    return hybrid_of_modes(aim.target, *modes)


def match(aim: Aim, parameters: Array) -> float:
    """Π_MRP at α, β, γ, σ (4,); σ makes no difference to it."""
    return match_ratio_product(aim.target.points, *_modes(aim, parameters))


def residuals(aim: Aim, parameters: Array) -> Array:
    """(cells,) √(hop/|Π_MRP|)·ΔT, whose squares sum to Π: what a least-squares method wants to see."""
    modes = _modes(aim, parameters)
    out = np.empty(sum(level.loud.size for level in aim.target.image.levels))
    distance(aim.target.image, *modes, differences=out)
    return np.asarray(out / np.sqrt(match_of_modes(aim.target, *modes)))


def _modes(aim: Aim, parameters: Array) -> tuple[Array, Array, Array]:
    return modes_of(parameters, aim.problem.lambda_hat, aim.problem.amplitude_hat)
