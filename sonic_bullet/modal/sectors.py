"""What every method for the modes hands on: sectors that no symmetry couples, and their surface (see methods.py).

Lengths by the body's diagonal L, density one: λ = λ' C/(ρL²) for stiffness in C, u = u'/√(ρL³).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from sonic_bullet.records import Array

MOST_MODES = 200
SHIFT = 20.0  # × (2V/A)²/L²: a third of the first elastic λ' of plates and bars, less of chunky bodies


class Sector(NamedTuple):
    """Modes that no symmetry couples with those of another sector.

    found: for each tensor λ (m,) ascending, elastic ones, and vectors (n, m) with VᵀMV = 1; stiff: for each tensor K.
    multiplicity: of each mode, 2 for degenerate pairs. place: what the method knows it by.
    """

    found: tuple[tuple[Array, Array], ...]
    stiff: tuple[Any, ...]
    mass: Any
    multiplicity: int
    place: Any


class Shown(NamedTuple):
    """Surface of a body in m, body frame, as `ModalModel` has it; shape (v, 3, b) float32: of the sectors' vectors in
    turn, each sector's multiplicity one after the other.
    """

    vertex_m: Array
    face: Array
    curvature_per_m: Array
    shape: Array


class Wanted(NamedTuple):
    """The lowest ``most`` modes, those up to ``limit``, and a margin beyond both: factor on λ."""

    limit: float
    most: int
    beyond: float = 1.0

    def bound(self, found: Sequence[tuple[Array, int]]) -> float:
        """The λ above which nothing is wanted, given what was found: λ (m,) and how many multiplicity of each."""
        value = np.concatenate([np.zeros(0), *(np.repeat(v, multiplicity) for v, multiplicity in found)])
        highest = np.partition(value, self.most - 1)[self.most - 1] if len(value) >= self.most else np.inf
        return self.beyond * min(self.limit, float(highest))


class ModalMethod(Protocol):
    """How the modes of one body are found. volume: in units of L³. meshed: whether elements' errors are in its λ."""

    @property
    def volume(self) -> float: ...
    @property
    def meshed(self) -> bool: ...

    def sectors(self, tensors: Sequence[Array], wanted: Wanted, say: Callable[[str], None]) -> list[Sector]:
        """The modes wanted of each tensor (6, 6). Raises ModalError, MeshError."""
        ...

    def shown(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> Shown:
        """Vectors (n, b), a matrix a sector, on the surface."""
        ...

    def note(self, sectors: Sequence[Sector]) -> str:
        """How it was done."""
        ...

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Estimated relative error in frequency of mode top[1] of sector top[0]; NaN where it is not known."""
        ...

    def finer(self) -> ModalMethod | None:
        """The same with a smaller error, None where it may cost no more."""
        ...
