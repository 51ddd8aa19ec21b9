"""What the optimisers are asked and what they answer: one recording against one body whose four numbers are unknown.

    (λ̂_j, â_j)  --{α, β, γ, σ}-->  λ = γ λ̂,  d = ½(α + βλ),  ω = √(λ − d²),  a = σ â
        [Ren, Yeh, Lin 2013, eq. 6, 7, 10-12]

λ̂ are the eigenvalues of the body at γ = E/ρ = 1 m²/s² and the assumed Poisson's ratio, â the amplitudes at its sensor
after the strike at σ = 1. Order of the four everywhere: α 1/s, β s, γ m²/s², σ.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.lab.lines.line_values import Features
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.errors import RecordError

LOWER = (1e-6, 1e-16, 1e-300, 1e-300)
UPPER = (1e6, 1.0, 1e300, 1e300)


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """One recording and one body. m modes, n samples.

    signal (n,): the recording, full scale 1, at features.sr. amplitude_hat (m,) is signed: modes of one strike share
    the sign of their sine at the onset, which decides how close pairs beat; pass magnitudes where it is not known.
    full_scale_db_spl: the level an rms of 1 stands for; 94 reads samples as pascals. lower, upper (4,): bounds of α, β,
    γ, σ. Raises RecordError where lengths differ, an eigenvalue is not above zero, all modes are mute, or bounds cross.
    """

    features: Features
    signal: Array
    lambda_hat: Array
    amplitude_hat: Array
    full_scale_db_spl: float = 94.0
    lower: Array = field(default_factory=lambda: np.array(LOWER))
    upper: Array = field(default_factory=lambda: np.array(UPPER))

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(self.lambda_hat))
        arrays: tuple[tuple[str, Array, int | None], ...] = (
            ("signal", self.signal, None),
            ("lambda_hat", self.lambda_hat, count),
            ("amplitude_hat", self.amplitude_hat, count),
            ("lower", self.lower, 4),
            ("upper", self.upper, 4),
        )
        for name, value, shape in arrays:
            bound = name in ("lower", "upper")  # no bound at all is a number beyond all others
            object.__setattr__(self, name, frozen_array(value, np.float64, (shape,), name, finite=not bound))
        if not (self.lambda_hat > 0).all():
            raise RecordError("an eigenvalue of the body is not above zero", "leave its rigid modes out")
        if not self.amplitude_hat.any():
            raise RecordError("no mode of the body sounds at this strike", "strike where the shapes move")
        if not (self.lower > 0).all() or not (self.lower < self.upper).all():
            raise RecordError("bounds of α, β, γ, σ cross or are not above zero", "give 0 < lower < upper")
        if not len(self.features.freq_hz):
            raise RecordError("the recording has no features", "a fit needs at least one damped sinusoid")


@dataclass(frozen=True, slots=True)
class Found:
    """The best parameters, their hybrid metric Π, and the cost: evaluations of Π, wall seconds, starts."""

    alpha_per_s: float
    beta_s: float
    gamma_m2_s2: float
    sigma: float
    metric: float
    evaluations: int
    seconds: float
    starts: int

    @property
    def parameters(self) -> Array:
        """(4,) α, β, γ, σ."""
        return np.array([self.alpha_per_s, self.beta_s, self.gamma_m2_s2, self.sigma])


def modes_of(parameters: Array, lambda_hat: Array, amplitude_hat: Array) -> tuple[Array, Array, Array]:
    """freq_hz, decay_per_s, amplitude (m,) of every mode; an overdamped one has freq_hz 0 and amplitude 0.

    Source: eq. 6, 7, 12.
    """
    alpha, beta, gamma, sigma = parameters
    eigen = gamma * lambda_hat
    decay = 0.5 * (alpha + beta * eigen)
    square = eigen - decay**2
    rings = square > 0
    return (
        np.where(rings, np.sqrt(np.where(rings, square, 0.0)) / (2 * np.pi), 0.0),
        decay,
        np.where(rings, sigma * amplitude_hat, 0.0),
    )
