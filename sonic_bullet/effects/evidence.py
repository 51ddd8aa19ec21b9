"""What an effect reads: objects' lines, models and recordings.

strikes of a case -> ObjectEvidence, one an object;  objects, material, effects found so far -> Evidence -> `propose`
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sonic_bullet.records import Array, Material, ModalModel

if TYPE_CHECKING:
    from sonic_bullet.effects.protocol import Effect


@dataclass(frozen=True, slots=True, eq=False)
class Elastic:
    """A body under any orthotropic elasticity, its axes the mesh's. material: isotropic, as the baseline has it, with
    the guessed density. phased: whether the signs of lines' amplitudes can be held against J ψ.

    look: C/ρ (6, 6) in m²/s² -> undamped freq_hz (m,). Of modes (k,), ∂ ln λ/∂(C_i/ρ) (9, k) of the constants C11 C22
    C33 C23 C13 C12 C44 C55 C66; and J ψ (s, m) up to a factor, NaN for strikes of unknown place. solve: the same tensor
    -> undamped ModalModel, strikes and sensor as last vertices.
    """

    material: Material
    phased: bool
    look: Callable[[Array], tuple[Array, Callable[[Array], Array], Array]]
    solve: Callable[[Array], ModalModel]


@dataclass(frozen=True, slots=True, eq=False)
class Poisson:
    """A body at any ratio ν of Poisson's, its E/ρ the baseline's. fitted: the baseline's ν; guess, sd: what was known
    of it before.

    at: ν -> undamped freq_hz (m,), and the modes there as sums (m, m) of the baseline's own, a column a mode.
    """

    fitted: float
    guess: float
    sd: float
    at: Callable[[float], tuple[Array, Array]]


@dataclass(frozen=True, slots=True, eq=False)
class ObjectEvidence:
    """One object's strikes: k lines that are modes, beside what the model so far expects, and what it leaves. source:
    what they were recorded from, the host's own.

    freq_hz, decay_per_s and their spreads (k,); amplitude (s, k) complex at the onset and its spread. mode: the modes
    of `model` each line stands for. model_hz (k,): the mesh's own, without corrections; expected_decay_per_s (k,),
    expected (s, k): of the model with the effects found so far. pattern (s, k): J ψ, real. foreign_*: lines that are no
    mode, amplitudes (s, f). model: the body with its strikes and sensor as last vertices, strike_vertex (s,),
    strike_direction (s, 3), sensor_vertex, sensor_direction (3,). signal, predicted (s, n) from the onset on, None for
    lists of features. noise (s,): rms. signed: phases are true. poisson: of `plain`, where nothing has moved its modes
    yet.
    """

    impulse_n_s: Array
    freq_hz: Array
    decay_per_s: Array
    freq_sd_hz: Array
    decay_sd_per_s: Array
    amplitude: Array
    amplitude_sd: Array
    mode: tuple[Array, ...]
    model_hz: Array
    expected_decay_per_s: Array
    expected: Array
    pattern: Array
    foreign_hz: Array
    foreign_decay_per_s: Array
    foreign_amplitude: Array
    foreign_sd: Array
    model: ModalModel | None
    strike_vertex: Array
    strike_direction: Array
    sensor_vertex: int
    sensor_direction: Array
    signal: Array | None
    predicted: Array | None
    noise: Array
    sr: int
    signed: bool
    push: Array  # (s, m) complex: every mode's amplitude at the sensor under the model so far, its pulse included
    pressed: Array  # (s, m) share of the strike's impulse that each mode takes, under the pulse so far
    all_hz: Array  # (m,) their frequencies
    plain: ModalModel | None  # `model` with the mesh's own frequencies
    strike: tuple[int, ...] = ()
    source: Any = None
    elastic: Elastic | None = None
    poisson: Poisson | None = None
    # (s, n) signal without what the model so far knows to ring beside the body, where there is such
    own: Array | None = None
    dry: bool = False  # whether lines are identified as they would be without the room they were recorded in

    @property
    def residual(self) -> Array:
        """signal - predicted (s, n)."""
        assert self.signal is not None and self.predicted is not None
        return np.asarray(self.signal - self.predicted)

    @property
    def omega(self) -> Array:
        """Undamped angular frequency (k,) of the lines."""
        return np.asarray(np.hypot(2 * np.pi * self.freq_hz, np.nan_to_num(self.decay_per_s)))


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """All that an effect may read: the objects' strikes, the material's α and β and the case's gain so far, effects
    found so far by id, band and seed.

    known: what the effect said of the whole evidence, or beside other effects: it is there to be fitted again, not to
    be looked for. held_out: whether this is the evidence without a strike, known's numbers to be estimated again; axes
    of degenerate pairs, which a linear body has no part of, stand as known has them.
    """

    observed: tuple[ObjectEvidence, ...]
    alpha_per_s: float
    beta_s: float
    gain: float
    found: tuple[str, ...]
    band_hz: tuple[float, float]
    seed: int = 0
    known: Effect | None = None
    held_out: bool = False

    @property
    def on_trial(self) -> bool:
        """Former name of `held_out`."""
        warnings.warn("Evidence.on_trial is now held_out", DeprecationWarning, stacklevel=2)
        return self.held_out
