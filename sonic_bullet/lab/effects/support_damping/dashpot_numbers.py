"""Numbers of the search for dashpots."""

from __future__ import annotations

from typing import NamedTuple


class _DashpotNumbers(NamedTuple):
    """Numbers of the search for dashpots, and what they may miss."""

    # of what dashpots add to a decay, of the decay, and of a pattern, relative: shapes err, and laws
    scatter: float = 0.05
    law: float = 0.02
    rough: float = 0.15
    width: float = 0.004  # of ln f and ln d, of a pair; of ln of a line's level
    decade: float = 0.4
    level: float = 0.3
    # squared spreads from where on a decay's misfit costs less, and that a pattern costs which nothing explains
    missed: float = 9.0
    gross: float = 4 * missed  # that a decay costs at most: a few spreads may be a shape's error, half or twice is none
    lost: float = 2 * gross + missed  # that a line costs at most
    mute: float = missed  # that a mode costs that no line shows: a mesh may have it elsewhere


DASHPOTS = _DashpotNumbers()
