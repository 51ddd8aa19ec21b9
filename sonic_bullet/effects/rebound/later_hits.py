"""Times of later hits of a strike, by correlation of a recording with the sound of one hit.

strike by strike: matching pursuit over delays                          [Mallat & Zhang 1993]
all strikes at once, by the exponent with which gaps go with strength: gain of a second hit over the first
    [Pati, Rezaiifar & Krishnaprasad 1993]
"""

from __future__ import annotations

MOST_HITS = 8
