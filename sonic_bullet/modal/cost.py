"""What solving a body with elements may cost, by counts that its mesh tells beforehand: no clock decides a result.

    work = unknowns (unknowns / FULL + START + modes)         factor; a Lanczos basis as long as START + modes
        [measured on a gong of 57 000 unknowns: 1.2 µs of processor a unit]

`MOST_WORK` of it, over all sizes of elements that one body is solved with, and filling and radiation are 60 s of one
core and 2 GB at most.
"""

from __future__ import annotations

import numpy as np

from sonic_bullet.modal.sectors import Wanted

MOST_WORK = 30e6
START = 75.0
FULL = {(2, True): 900.0, (3, True): 590.0, (2, False): 300.0, (3, False): 200.0}
"""By degree, and of thin bodies or lumps, whose factor is fuller."""


def work(unknowns: float, modes: int, degree: int, thin: bool) -> float:
    """Of one solution."""
    return unknowns * (unknowns / FULL[degree, thin] + START + modes)


def most_unknowns(spare: float, modes: int, degree: int, thin: bool, coarser: float = 0.0) -> float:
    """What so much work is enough for, with ``coarser`` as many of a coarser body beside them."""
    square, line = (1 + coarser**2) / FULL[degree, thin], (1 + coarser) * (START + modes)
    return float((np.sqrt(line**2 + 4 * square * max(spare, 0.0)) - line) / (2 * square))


def modes_below(wave: float, area: float, wall: float, wanted: Wanted) -> int:
    """About how many modes there are up to the shortest wave number, at most those wanted: bending ones of a wall of
    both sides' area [Courant & Hilbert 1924, ch. VI.4], or shear waves that fill a lump.
    """
    found = max(area / 2 * wave**2 / (4 * np.pi), area * wall / 2 * wave**3 / (3 * np.pi**2))
    return int(min(found + 1, wanted.most))
