"""Base classes of effects; what they act on is in stages.py.

An effect is physics with few parameters. The laboratory fits them to evidence (`sonic_bullet.lab.effects`; an effect
from elsewhere brings its own `propose`). An effect never scores itself: the diagnosis renders strikes that were not
fitted, with and without it. What a host must know beforehand is in its `Traits`; what only some can do (remove a room
from the lines, turn or split pairs, add another resonator) in small classes that they derive from.
"""

from __future__ import annotations

import importlib
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from sonic_bullet.effects.common.declared_numbers import Number, Numbers, check_numbers, free_numbers, reported_numbers
from sonic_bullet.effects.stages import Impact, Ring, Sound, Stage
from sonic_bullet.records import Array, ModalModel
from sonic_bullet.signal.log_spectral import Floor

if TYPE_CHECKING:
    from sonic_bullet.lab.effects.evidence import Evidence, ObjectEvidence

__all__ = [
    "CARRIES",
    "ActsAtPlaces",
    "BaselineChange",
    "ChangesBaseline",
    "Cost",
    "Dereverberates",
    "Effect",
    "Evidence",
    "Impact",
    "Mixing",
    "Number",
    "Numbers",
    "ObjectEvidence",
    "Owner",
    "Ring",
    "RingsAlong",
    "RotatesPairs",
    "Sound",
    "SplitsPairs",
    "Stage",
    "Traits",
    "sort_modes",
]


class Owner(Enum):
    """Owner of an effect: whose property it is.

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
    """Cost of proposing an effect, which decides when it is asked."""

    CHEAP = "cheap"
    COSTLY = "costly"  # asked last, and only where cheaper candidates leave much open
    SEARCHES = "searches"  # works side by side, so it is asked by itself


class Mixing(Enum):
    """Change of the mode shapes by an effect that moves modes."""

    NONE = "none"  # each mode stays itself
    NEIGHBOURS = "neighbours"  # a mode takes on its neighbours' shapes: dashpots
    ALL = "all"  # every mode is a sum of all old ones, so none keeps its own correction: a mass at a point


@dataclass(frozen=True, slots=True)
class Traits:
    """Properties of a kind of effect that a host must know before it asks for a proposal.

    Attributes
    ----------
    moves_modes : bool
        Modes change their frequency or shape: lines are paired and corrections estimated anew. True of all that act on
        the MATERIAL.
    mixing : Mixing
        The change of their shapes.
    replaces_rayleigh : bool
        The effect replaces α and β, and has these two numbers less than it states.
    cost : Cost
        When it is asked.
    by_line : bool
        Its numbers are of single lines, which no other line determines, or one line may show it: in cross-validation it
        is given all lines, of the other strikes.
    needs_unknown_medium : bool
        It is the medium's: where that is known, the baseline has it, or there is none. It acts on other objects by
        their own shapes.
    """

    moves_modes: bool = False
    mixing: Mixing = Mixing.NONE
    replaces_rayleigh: bool = False
    cost: Cost = Cost.CHEAP
    by_line: bool = False
    needs_unknown_medium: bool = False


@dataclass(frozen=True, slots=True)
class BaselineChange:
    """Changes of the baseline's numbers that an effect has found with its own; None, 0 and 1 where there are none.

    Attributes
    ----------
    alpha_per_s, beta_s : float
        Rayleigh damping, both or neither.
    stretch : float
        ln of all frequencies of the bare body over the baseline's.
    poisson_ratio : float
        ν.
    onset_gain : float
        Modes at the onset over what their lines give.
    """

    alpha_per_s: float | None = None
    beta_s: float | None = None
    stretch: float = 0.0
    poisson_ratio: float | None = None
    onset_gain: float = 1.0


class Effect(ABC):
    """One physical effect: a frozen dataclass of its parameters, each declared once by `Annotated[..., Number(...)]`.

    Checks, reports and the count of free numbers follow from the declarations. The docstring of each gives its
    equation. What only some effects can do is in the small classes below, from which they derive; a host asks for
    those, never for a name.
    """

    id: ClassVar[str]
    stage: ClassVar[Stage]
    owner: ClassVar[Owner]
    reference: ClassVar[str]
    traits: ClassVar[Traits] = Traits()

    def __post_init__(self) -> None:
        """Check the numbers by their declarations.

        Raises
        ------
        RecordError
            A number is out of its range, or lists that belong together are not as long as each other.
        """
        check_numbers(self)

    @abstractmethod
    def apply(self, x: Any) -> Any:
        """Apply the effect to its stage's value; x is not changed."""

    @classmethod
    def propose(cls, evidence: Evidence) -> Self | None:
        """Fit an effect from elsewhere to the evidence; None where the evidence suggests none, or nobody looks for it.

        How the package's own are looked for is in `sonic_bullet.lab.effects`.
        """
        return None

    def parameters(self) -> dict[str, Any]:
        """Return its numbers by name with unit, for reports and presets."""
        return reported_numbers(self)

    def freedom(self) -> int:
        """Count the numbers that were free when it was proposed."""
        return free_numbers(self)


class ChangesBaseline(Effect):
    """An effect with which the baseline's own numbers are others."""

    @abstractmethod
    def baseline_change(self) -> BaselineChange:
        """Return the changes."""


class Dereverberates(Effect):
    """An effect that hides the modes' own decays and levels, and can be removed from the lines (a room)."""

    def dereverberate(self, observed: ObjectEvidence) -> ObjectEvidence:
        """Return the lines as they would be without it: as they are, where it cannot tell."""
        return observed

    def identified_from(self, signal: Array, sound: Array, noise: Floor, sr: int, *, fully: bool = False) -> Self:
        """Identify the effect's response from recordings; as it is, where it has none.

        Parameters
        ----------
        signal : (s, n)
            Recordings of strikes.
        sound : (s, n)
            The same without the effect, synthesized.
        noise : Floor
            The recordings' noise.
        sr : int
            Sampling rate in Hz.
        fully : bool
            Iterate to convergence.
        """
        return self


class RotatesPairs(Effect):
    """An effect under which the axes of degenerate pairs are observable, which a linear body does not show."""

    @abstractmethod
    def turn_pairs(self, x: ModalModel) -> ModalModel:
        """Turn degenerate pairs to their own axes."""

    @abstractmethod
    def angles(self) -> int:
        """Count its free numbers that are such axes: all fitted strikes share those, like a correction."""


class SplitsPairs(Effect):
    """An effect that splits degenerate pairs: their corrections are its own, not the mesh's."""

    @abstractmethod
    def observed_correction(self, freq_hz: Array) -> Array:
        """Compute the relative correction (m,) of the mesh's modes to the middles of split pairs.

        Parameters
        ----------
        freq_hz : (m,)
            Frequencies of the mesh's modes, ascending.
        """


class RingsAlong(Effect):
    """An effect that adds another resonator: its lines are none of the body's modes, and no other effect's evidence."""

    @abstractmethod
    def lines(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return its frequencies in Hz and decays in 1/s."""


class ActsAtPlaces(Effect):
    """An effect at places of the surface, which may have images under the body's symmetry that do the same."""

    @abstractmethod
    def places(self) -> tuple[tuple[float, float, float], ...]:
        """Return its places (p, 3) in the mesh's frame, in metres."""


def sort_modes(x: ModalModel, freq_hz: Array, decay_per_s: Array, shape: Array | None = None) -> ModalModel:
    """Return a model with other modes in ascending order.

    Parameters
    ----------
    x : ModalModel
        The model.
    freq_hz, decay_per_s : (m,)
        Its new frequencies and decays.
    shape : (v, 3, m)
        Its new shapes, the old ones where None.
    """
    order = np.argsort(freq_hz, kind="stable")
    shape = x.shape if shape is None else shape
    if (np.diff(order) < 0).any():
        shape = shape[:, :, order]
    return replace(x, freq_hz=freq_hz[order], decay_per_s=decay_per_s[order], shape=shape)


def __getattr__(name: str) -> Any:
    """Import what an effect from elsewhere reads when it is first used: that is the laboratory's."""
    if name in ("Evidence", "ObjectEvidence"):
        return vars(importlib.import_module("sonic_bullet.lab.effects.evidence"))[name]
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
