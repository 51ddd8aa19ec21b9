"""Cost of a finite-element solution, predicted from counts of its mesh: no clock decides a result.

    work = unknowns (unknowns / full + start + modes)         factor; a Lanczos basis of start + modes vectors
        [measured on a gong of 57 000 unknowns: 1.2 µs of processor a unit]

`MOST_WORK` bounds the work over all element sizes that one body is solved with. With filling and radiation that is at
most 60 s of one core and 2 GB.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from sonic_bullet.modal.sectors import WantedModes

MOST_WORK = 30e6

START_WORK = 75.0
# by degree, and by whether the body is thin or a lump, whose factor is fuller
FULL_FACTOR: Mapping[tuple[int, bool], float] = MappingProxyType(
    {(2, True): 900.0, (3, True): 590.0, (2, False): 300.0, (3, False): 200.0}
)

FINER_EDGE = 0.7  # from one edge to the next: half the elements of a wall
# of thin bodies and of lumps, whose factor is full: 10 s of processor and 1.4 GB at most. An edge_m allows more
MOST_UNKNOWNS: Mapping[bool, int] = MappingProxyType({True: 70_000, False: 30_000})
CUBIC_UNKNOWNS = 100_000  # that degree 3 may take; degree 2 has a third of them on the same elements
# by degree, of thin walls; less of lumps
UNKNOWNS_A_TET: Mapping[int, float] = MappingProxyType({2: 6.0, 3: 18.0})

# what a draft spends on a body: a few tenths of a second of processor
DRAFT_TETS = 350.0  # quadratic ones: some 2000 unknowns
DRAFT_ACCURACY = 0.1  # of boxes and bodies of revolution, which have methods of their own
# of lumps of a span all below 20 kHz: those above a strike's spectrum carry its low end
DRAFT_MOST_MODES = 80


def work(unknowns: float, modes: int, degree: int, thin: bool) -> float:
    """Predict the work of one solution."""
    return unknowns * (unknowns / FULL_FACTOR[degree, thin] + START_WORK + modes)


def most_unknowns(spare: float, modes: int, degree: int, thin: bool, coarser: float = 0.0) -> float:
    """Return how many unknowns the work ``spare`` allows, a coarser body of ``coarser`` times as many included."""
    square, line = (1 + coarser**2) / FULL_FACTOR[degree, thin], (1 + coarser) * (START_WORK + modes)
    return float((np.sqrt(line**2 + 4 * square * max(spare, 0.0)) - line) / (2 * square))


def modes_below(wave: float, area: float, wall: float, wanted: WantedModes) -> int:
    """Estimate how many modes lie below the wave number ``wave``, at most those wanted.

    Bending modes of a wall of both sides' area [Courant & Hilbert 1924, ch. VI.4], or shear waves that fill a lump.
    """
    found = max(area / 2 * wave**2 / (4 * np.pi), area * wall / 2 * wave**3 / (3 * np.pi**2))
    return int(min(found + 1, wanted.most))
