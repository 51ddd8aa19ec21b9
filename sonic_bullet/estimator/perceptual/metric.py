"""The hybrid metric: how far α, β, γ, σ are from a recording.

    Π = Π_psycho/|Π_MRP|                                                              [Ren, Yeh, Lin 2013, eq. 27]

Π_psycho is divided by its value for silence (image.py), so that Π has no unit and its minimum stays where it was. The
constants the paper's lost appendix held are the fields of `Constants`; docs/measured/estimator.md shows what hangs on
them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sonic_bullet.estimator.perceptual.image import Image, distance, image, plain_distance
from sonic_bullet.estimator.perceptual.matching import Points, match_ratio_product, points
from sonic_bullet.estimator.perceptual.problem import Problem, modes_of
from sonic_bullet.records import Array

MATCH_FLOOR = 1e-6  # a match ratio product of zero would make Π infinite


@dataclass(frozen=True, slots=True)
class Constants:
    """What the metric leaves free: the image's grid (image.py) and the plane of the match ratio product
    (matching.py).
    """

    bark_step: float = 0.5
    levels: int = 5
    shortest_s: float = 0.0107
    seconds: float = 1.0
    per_bark: float = 4.0
    per_duration: float = 1.0
    near: float = 0.1
    power: float = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A problem with the recording's image and points worked out once."""

    problem: Problem
    image: Image
    points: Points


def target(problem: Problem, constants: Constants | None = None) -> Target:
    """Raises RecordError where the recording is too short or too quiet for an image."""
    c = constants or Constants()
    made = image(
        problem.signal, problem.features.sr, problem.features.onset_s, problem.full_scale_db_spl,
        bark_step=c.bark_step, levels=c.levels, shortest_s=c.shortest_s, seconds=c.seconds,
    )  # fmt: skip
    return Target(
        problem,
        made,
        points(problem.features, per_bark=c.per_bark, per_duration=c.per_duration, near=c.near, power=c.power),
    )


def hybrid(target: Target, parameters: Array, *, plain: bool = False) -> float:
    """Π at α, β, γ, σ (4,). plain: the image by synthesis and Fourier transforms instead of in closed form."""
    modes = modes_of(parameters, target.problem.lambda_hat, target.problem.amplitude_hat)
    return hybrid_of_modes(target, *modes, plain=plain)


def hybrid_of_modes(
    target: Target, freq_hz: Array, decay_per_s: Array, amplitude: Array, *, plain: bool = False
) -> float:
    """Π of damped sinusoids (m,) Im A e^{(−d + iω)t}, whatever made them.

    A real: sines; complex (not with ``plain``): of any phase.
    """
    match = match_ratio_product(target.points, freq_hz, decay_per_s, np.abs(amplitude))
    measure = plain_distance if plain else distance
    return measure(target.image, freq_hz, decay_per_s, amplitude) / max(-match, MATCH_FLOOR)


def match(target: Target, parameters: Array) -> float:
    """Π_MRP at α, β, γ, σ (4,); σ makes no difference to it."""
    return match_ratio_product(
        target.points, *modes_of(parameters, target.problem.lambda_hat, target.problem.amplitude_hat)
    )


def residuals(target: Target, parameters: Array) -> Array:
    """(cells,) √(hop/|Π_MRP|)·ΔT, whose squares sum to Π: what a least-squares method wants to see."""
    modes = modes_of(parameters, target.problem.lambda_hat, target.problem.amplitude_hat)
    out = np.empty(sum(level.loud.size for level in target.image.levels))
    distance(target.image, *modes, differences=out)
    return np.asarray(out / np.sqrt(max(-match_ratio_product(target.points, *modes), MATCH_FLOOR)))
