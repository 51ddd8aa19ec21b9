"""The bodies that a log of a world names: who lives under which code, since when and until when, and where each was
last.

    code of a link -> index into the bodies; a record that ended stays, its code may be given anew
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sonic_bullet.listener.frames import Roster, rows_of
from sonic_bullet.listener.start import start_table
from sonic_bullet.records import Array, Body


class KnownBodies:
    """State of that for one world. pose_m (b, 7): position and orientation, the last of who is gone."""

    def __init__(self) -> None:
        self.records: list[Body] = []
        self.live: dict[int, int] = {}
        self.pose_m = np.zeros((0, 7))
        self._roster: Roster | None = None
        self._start: Array = np.zeros(0)

    def append(self, code: int, record: Body, pose_m: Array) -> None:
        """A record of the link of that code begins, at a pose (7,)."""
        self.live[code] = len(self.records)
        self.records.append(record)
        self.pose_m = np.concatenate([self.pose_m, pose_m[None]])
        self._roster = None

    def close(self, codes: Iterable[int], step: int) -> None:
        """The records of the links of these codes end before that step."""
        for code in codes:
            if code in self.live:
                index = self.live.pop(code)
                self.records[index] = replace(self.records[index], until_step=step)
        self._roster = None

    def gone(self, roster: Roster) -> list[int]:
        """Codes of those who live and whom a roster does not hold."""
        codes = np.array(list(self.live), np.int64)
        return [int(code) for code in codes[rows_of(roster, codes) < 0]]

    def index(self, roster: Roster) -> Array:
        """(n,) index into the records of each row of a roster, -1 for who never met anybody."""
        return np.array([self.live.get(int(code), -1) for code in roster.code], np.int64)

    def start(self, roster: Roster) -> Array:
        """START rows (n,) of a roster, with code, static and index filled; the same table while neither changes."""
        if self._roster is not roster:
            self._roster, self._start = roster, start_table(roster)
            self._start["index"] = self.index(roster)
        return self._start


def alike(first: Body, second: Body) -> bool:
    """Whether two records can be of one body: the same mass, inertia and curvature."""
    same = first.mass_kg == second.mass_kg and np.array_equal(first.inertia_kg_m2, second.inertia_kg_m2)
    return same and np.array_equal(first.curvature_per_m, second.curvature_per_m, equal_nan=True)
