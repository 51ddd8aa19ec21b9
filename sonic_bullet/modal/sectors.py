"""Interface of the methods for modes: sectors that no symmetry couples, and their surface (see methods.py).

Lengths by the body's diagonal L, density one: λ = λ' C/(ρL²) for stiffness in C, u = u'/√(ρL³).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from sonic_bullet.records import Array, TouchedSurface

MOST_MODES = 200
SHIFT_RATIO = 20.0  # × (2V/A)²/L²: a third of the first elastic λ' of plates and bars, less of chunky bodies


class Sector(NamedTuple):
    """Modes that no symmetry couples with those of another sector.

    Attributes
    ----------
    found : for each tensor λ (m,) of elastic modes, ascending, and vectors (n, m) with VᵀMV = 1
    stiff : for each tensor K
    mass : M
    multiplicity : of each mode, 2 for degenerate pairs
    unknowns : the method's own: nodes, parities, or the order around an axis
    """

    found: tuple[tuple[Array, Array], ...]
    stiff: tuple[Any, ...]
    mass: Any
    multiplicity: int
    unknowns: Any


class SurfaceShapes(NamedTuple):
    """Surface of a body in m, body frame, as `ModalModel` has it.

    shape (v, 3, b) float32 holds the sectors' vectors in turn, repeated by each sector's multiplicity.
    """

    vertex_m: Array
    face: Array
    curvature_per_m: Array
    shape: Array
    touched: TouchedSurface | None = None


class WantedModes(NamedTuple):
    """Modes wanted: the lowest ``most``, those up to ``limit``, and a margin ``beyond`` both, as a factor on λ."""

    limit: float
    most: int
    beyond: float = 1.0

    def bound(self, found: Sequence[tuple[Array, int]]) -> float:
        """Return the λ above which nothing is wanted, given λ (m,) found and the multiplicity of each array."""
        value = np.concatenate([np.zeros(0), *(np.repeat(v, multiplicity) for v, multiplicity in found)])
        highest = np.partition(value, self.most - 1)[self.most - 1] if len(value) >= self.most else np.inf
        return self.beyond * min(self.limit, float(highest))


class ModalMethod(Protocol):
    """Method that finds the modes of one body."""

    @property
    def volume(self) -> float:
        """Volume in units of L³."""
        ...

    @property
    def meshed(self) -> bool:
        """Whether λ carries elements' errors."""
        ...

    def sectors(self, tensors: Sequence[Array], wanted: WantedModes) -> list[Sector]:
        """Solve for the modes wanted of each tensor (6, 6). Raises ModalError, MeshError."""
        ...

    def evaluate_on_surface(self, sectors: Sequence[Sector], vectors: Sequence[Array]) -> SurfaceShapes:
        """Evaluate vectors (n, b), a matrix a sector, on the surface."""
        ...

    def note(self, sectors: Sequence[Sector]) -> str:
        """Describe how the modes were found."""
        ...

    def error(self, sectors: Sequence[Sector], tensor: Array, top: tuple[int, int]) -> float:
        """Estimate the relative error in frequency of mode top[1] of sector top[0]; NaN where it is not known."""
        ...

    def surface_error(self, sectors: Sequence[Sector], tensor: Array) -> float:
        """Estimate the largest relative change of frequencies by what the surface given leaves open."""
        ...

    def finer(self) -> ModalMethod | None:
        """Return the same method with a smaller error, None where it may cost no more."""
        ...

    def most_fall(self) -> float:
        """Return by how many times its error falls at most, as fine as it may be."""
        ...
