"""What effects read, and what every effect is; what they act on is in stages.py.

An effect is physics with few parameters. `propose` reads them off the evidence, or says None; it never scores itself:
the diagnosis renders strikes that were not fitted, with and without it. What a host must know beforehand stands in its
`Traits`; what only some can do (a room is taken out of the lines, pairs are turned or split, something rings beside the
body) in small classes that they derive from.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from sonic_bullet.effects.stages import Impact, Ring, Sound, Stage
from sonic_bullet.records import Array, Material, ModalModel

__all__ = [
    "CARRIES",
    "Alternatives",
    "BaselineChange",
    "ChangesBaseline",
    "Cost",
    "Dereverberates",
    "Effect",
    "Elastic",
    "Evidence",
    "Impact",
    "Mixing",
    "ObjectEvidence",
    "Owner",
    "Poisson",
    "Ring",
    "RingsAlong",
    "RotatesPairs",
    "Sound",
    "SplitsPairs",
    "Stage",
    "Traits",
    "ascending",
]


class Owner(Enum):
    """Whose an effect is.

    What belongs to material and object goes into a preset; to material, room and chain, to other objects too.
    """

    MATERIAL = "material"
    OBJECT = "object"
    FIXTURE = "fixture"
    STRIKER = "striker"
    ROOM = "room"
    CHAIN = "chain"


CARRIES = frozenset({Owner.MATERIAL, Owner.STRIKER, Owner.ROOM, Owner.CHAIN})  # over to another object of the material


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


class Cost(Enum):
    """What asking an effect costs, and so when it is asked."""

    CHEAP = "cheap"
    COSTLY = "costly"  # asked last, and only where cheaper candidates leave much open
    SEARCHES = "searches"  # works side by side, so it is asked by itself


class Mixing(Enum):
    """What an effect that moves modes makes of their shapes."""

    NONE = "none"  # each mode stays itself
    NEIGHBOURS = "neighbours"  # a mode takes on its neighbours' shapes: dashpots
    ALL = "all"  # every mode is a sum of all old ones, so none keeps its own correction: a mass at a point


@dataclass(frozen=True, slots=True)
class Traits:
    """What a host must know of a kind of effect before it asks it anything.

    moves_modes: modes are no longer where, or what, they were: lines are paired and corrections learnt anew. What acts
    on the MATERIAL always does. mixing: what becomes of their shapes then. replaces_rayleigh: it is a law of its own in
    the place of α and β, and has these two numbers less than it states. cost: when it is asked. by_line: its numbers
    are of single lines, which no other line states, or it may be observed in one: in cross-validation it is given all
    lines, of the other strikes. certain: it is proposed where lines agree on it, each by its own baseband, and nowhere
    else, and goes with level: a smaller drop will do on strikes left out, of which a loud one gains most.
    """

    moves_modes: bool = False
    mixing: Mixing = Mixing.NONE
    replaces_rayleigh: bool = False
    cost: Cost = Cost.CHEAP
    by_line: bool = False
    certain: bool = False


@dataclass(frozen=True, slots=True)
class BaselineChange:
    """What an effect has found of the baseline's own numbers beside its own; None, 0 and 1 where it leaves them.

    alpha_per_s, beta_s: Rayleigh's, both or neither. stretch: ln of what all frequencies of the bare body are to the
    baseline's. poisson_ratio: ν. onset_gain: modes at the onset over what their lines say.
    """

    alpha_per_s: float | None = None
    beta_s: float | None = None
    stretch: float = 0.0
    poisson_ratio: float | None = None
    onset_gain: float = 1.0


class ChangesBaseline(ABC):
    """An effect beside which the baseline's own numbers are others."""

    @abstractmethod
    def baseline_change(self) -> BaselineChange:
        """What it found of them."""


class Dereverberates(ABC):
    """An effect that hides the modes' own decays and levels from the lines, and can take itself out of them
    (a room).
    """

    @abstractmethod
    def dereverberated(self, observed: ObjectEvidence) -> ObjectEvidence:
        """The same lines as they would be without it."""

    @abstractmethod
    def identified_from(self, signal: Array, sound: Array, noise: Array, sr: int, *, fully: bool = False) -> Self:
        """The effect with its response identified from recordings (s, n) and what is played without it (s, n); noise
        (s,): rms. fully: to the end.
        """


class RotatesPairs(ABC):
    """An effect under which the axes of degenerate pairs are observed, which in a linear body nothing shows."""

    @abstractmethod
    def turned(self, x: ModalModel) -> ModalModel:
        """The modes as they were, degenerate pairs about their own axes."""

    @abstractmethod
    def angles(self) -> int:
        """How many of its free numbers are such axes: all fitted strikes state those once, like a correction."""


class SplitsPairs(ABC):
    """An effect that sets degenerate pairs apart: their corrections are its own, not the mesh's."""

    @abstractmethod
    def observed_correction(self, freq_hz: Array) -> Array:
        """Relative correction (m,) of the mesh's modes freq_hz (m,), ascending, to the middle of what was split."""


class RingsAlong(ABC):
    """An effect that rings beside the body: its lines are none of the body's modes, and nobody else's evidence."""

    @abstractmethod
    def lines(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Frequencies in Hz and decays in 1/s of what rings."""


class Alternatives(ABC):
    """An effect with choices to which no step leads from where it is."""

    @abstractmethod
    def others(self) -> tuple[Effect, ...]:
        """The same effect by its other choices."""


class Effect(Protocol):
    """One physical effect: a frozen dataclass of its parameters.

    Every member also has a docstring that gives its equation.

    What only some effects can do they say by deriving from one of the small classes above; a host asks for those, never
    for a name.
    """

    id: ClassVar[str]
    stage: ClassVar[Stage]
    owner: ClassVar[Owner]
    reference: ClassVar[str]
    traits: ClassVar[Traits]

    def apply(self, x: Any) -> Any:
        """The stage's value with the effect in it; x is left as it is."""
        ...

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """The effect with the parameters that the evidence suggests, or None where it suggests none."""
        ...

    def parameters(self) -> dict[str, Any]:
        """Numbers, by name with unit, that say what it is: what a report and a preset hold."""
        ...

    def freedom(self) -> int:
        """How many numbers were free when it was proposed."""
        ...


def ascending(x: ModalModel, freq_hz: Array, decay_per_s: Array, shape: Array | None = None) -> ModalModel:
    """The model with other frequencies, decays (m,) and shapes (v, 3, m), its own where None, in ascending order."""
    order = np.argsort(freq_hz, kind="stable")
    shape = x.shape if shape is None else shape
    if (np.diff(order) < 0).any():
        shape = shape[:, :, order]
    return replace(x, freq_hz=freq_hz[order], decay_per_s=decay_per_s[order], shape=shape)
