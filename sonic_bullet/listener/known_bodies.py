"""The bodies that a log of a world names: the link of each code, since when and until when.

code of a link -> index into the bodies, ascending and never reused; a code may be reused
roster -> START.index, START.pose, and the indices (b,) of those whose poses a step holds
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sonic_bullet.listener.frames import Roster, rows_of
from sonic_bullet.listener.start import start_table
from sonic_bullet.records import Array, Body
from sonic_bullet.records.contacts import first_bodies


class KnownBodies:
    """Records of the bodies of one world.

    Attributes
    ----------
    records
        By index, in its order: of all bodies or, where ended records are dropped, of the living.
    count
        Number of all there ever were.
    body : Array, shape (b,)
        Indices of those in the roster last asked for, ascending; the same array while they are the same.
    """

    def __init__(self) -> None:
        self.records: dict[int, Body] = {}
        self.count = 0
        self.live: dict[int, int] = {}
        self.body: Array = first_bodies(0)
        self._roster: Roster | None = None
        self._start: Array = np.zeros(0)

    def append(self, code: int, record: Body) -> None:
        """Begin a record of the link of that code."""
        self.live[code] = self.count
        self.records[self.count] = record
        self.count += 1
        self._roster = None

    def close(self, codes: Iterable[int], step: int, *, keep: bool) -> None:
        """End the records of these links before that step; keep: retain them, ended."""
        for code in codes:
            if code in self.live:
                index = self.live.pop(code)
                if keep:
                    self.records[index] = replace(self.records[index], until_step=step)
                else:
                    del self.records[index]
        self._roster = None

    def gone(self, roster: Roster) -> list[int]:
        """List the codes of living links that a roster does not hold."""
        codes = np.array(list(self.live), np.int64)
        return [int(code) for code in codes[rows_of(roster, codes) < 0]]

    def enter(self, start: Array) -> None:
        """Fill index and pose of START rows (n,), -1 for links without a record; set `body` to those indices."""
        start["index"] = index = np.array([self.live.get(code, -1) for code in start["code"].tolist()], np.int64)
        body = np.sort(index[index >= 0])
        if not np.array_equal(body, self.body):
            first = first_bodies(len(body))
            self.body = first if np.array_equal(body, first) else body
            self.body.flags.writeable = False
        start["pose"] = np.searchsorted(self.body, index)

    def start(self, roster: Roster) -> Array:
        """Return START rows (n,) of a roster with code, static, index and pose filled.

        The table is the same while roster and records are.
        """
        if self._roster is not roster:
            self._roster, self._start = roster, start_table(roster)
            self.enter(self._start)
        return self._start


def alike(first: Body, second: Body) -> bool:
    """Tell whether two records can be of one body: same mass, inertia and curvature."""
    same = first.mass_kg == second.mass_kg and np.array_equal(first.inertia_kg_m2, second.inertia_kg_m2)
    return same and np.array_equal(first.curvature_per_m, second.curvature_per_m, equal_nan=True)
