"""States of a transmission, of modes of one body that sound at another that it touches (src/bank/transmission.hpp)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import TRANSMISSION_PHASES

MOST_PARTNERS = 8
"""Partners to which a body transmits at a time, those that fade out among them."""


class _Phases(NamedTuple):
    """States of a transmission."""

    off: int
    steady: int
    coming: int  # from the next block on rising
    rising: int
    leaving: int  # from the next block on falling
    falling: int
    brief: int  # rises and is to fall


PHASE = _Phases(**TRANSMISSION_PHASES)

SILENCED = np.array([PHASE.off, PHASE.steady, PHASE.steady, PHASE.steady, PHASE.off, PHASE.off, PHASE.off])
"""State that each becomes where nothing sounds any more, and nothing has to fade."""
