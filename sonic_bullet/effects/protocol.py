"""What effects read, and what every effect is; what they act on is in stages.py.

An effect is physics with few parameters. `propose` reads them off the evidence, or says None; it never scores itself:
the diagnosis renders strikes that were not fitted, with and without it. What a host must know beforehand stands in its
`Traits`; what only some can do (a room is taken out of the lines, pairs are turned or split, something rings beside the
body) in small classes that they derive from.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from sonic_bullet.effects.evidence import Elastic, Evidence, ObjectEvidence, Poisson
from sonic_bullet.effects.stages import Impact, Ring, Sound, Stage
from sonic_bullet.records import Array, ModalModel

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
