"""Impacts of soft contacts, which brake a body over many steps, collected to one strike: src/listener/soft_impacts.hpp.

CONTACT rows of a step -> those that pass, and of each impact that is over one row a contact point
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet._engine import CONTACT, HELD_POINT, LONGEST_IMPACT_S, PAIR_LOAD, SOFT_IMPACT, collect_rows
from sonic_bullet.records import Array

__all__ = ["LONGEST_IMPACT_S"]

# places in the counts of an `ImpactTables`
IMPACTS_AT = 0
HELD_AT = 1
PAIRS_AT = 2
ROWS_AT = 3


class ImpactTables(NamedTuple):
    """Tables of one step: impacts and points held, pairs of the step before and of this one, rows that it gives out."""

    impact: Array
    held: Array
    before: Array
    now: Array
    out: Array
    counts: Array


class SoftImpacts:
    """Impacts under way in one world."""

    def __init__(self) -> None:
        self._impact: Array = np.zeros(0, SOFT_IMPACT)
        self._held: Array = np.zeros(0, HELD_POINT)
        self._before: Array = np.zeros(0, PAIR_LOAD)

    def collect(self, row: Array, dt_s: float, gravity_m_s2: tuple[float, ...], mass_kg: Array) -> Array:
        """Return the rows of CONTACT that a step gives out.

        Parameters
        ----------
        row : Array of CONTACT, shape (k,)
            Its contacts.
        dt_s, gravity_m_s2
            Of the step: an approach that gravity makes in one step begins no impact.
        mass_kg : Array, shape (k,)
            Of the lighter body of each row.
        """
        k = len(row)
        if not k and not len(self._impact):
            self._before = self._before[:0]
            return row
        impact = np.concatenate([self._impact, np.zeros(k, SOFT_IMPACT)])
        held = np.concatenate([self._held, np.zeros(k, HELD_POINT)])
        out, now = np.zeros(k + len(held), CONTACT), np.zeros(k, PAIR_LOAD)
        counts = np.array([len(self._impact), len(self._held), 0, 0])
        g = float(np.linalg.norm(gravity_m_s2))
        collect_rows(row, g * mass_kg, dt_s, 1.1 * g * dt_s, ImpactTables(impact, held, self._before, now, out, counts))
        self._impact, self._held = impact[: counts[IMPACTS_AT]].copy(), held[: counts[HELD_AT]].copy()
        self._before = now[: counts[PAIRS_AT]]
        return out[: counts[ROWS_AT]]
