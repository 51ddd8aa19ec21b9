"""Tables of the bank and the numbers that Python shares with the engine; see src/bank/layout.hpp for what they mean.

BANK_BODY   a body: its lanes in the flat arrays, and the pole that its three translations share
RINGING     its activity: flags, the translations' state, the first of its strikes
BANK_STRIKE a pulse under way: a pool of rows, those of a body linked in order of start, then of arrival
BLOCK       samples of free ringing at a time; LANE_PAIR: a body's lanes come in whole groups of it
FLOOR       modes with |z| below it (in √J·√2) are set to zero
FLUSH       samples, gains and forces below it become 0: no product of theirs becomes subnormal
"""

from __future__ import annotations

from sonic_bullet._engine import BANK_BODY, BANK_STRIKE, BLOCK, FLOOR, FLUSH, LANE_PAIR, RINGING, TRANSMISSION

__all__ = [
    "BANK_BODY",
    "BANK_STRIKE",
    "BLOCK",
    "FLOOR",
    "FLUSH",
    "LANE_PAIR",
    "RINGING",
    "TRANSMISSION",
]
