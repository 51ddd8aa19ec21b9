"""All bodies that a listener ever met, by value, and where each was last seen.

A record never goes: one that ends stays under its number, for the log's contacts count by it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sonic_bullet.listener.frames import Roster
from sonic_bullet.records import Array, Body


class BodyRecords:
    """bodies: in the order that Contacts.a and Contacts.b count them. position_m (b, 3), quaternion_xyzw (b, 4).

    The world that keeps them writes the poses in place.
    """

    def __init__(self) -> None:
        self.bodies: list[Body] = []
        self.position_m = np.zeros((0, 3))
        self.quaternion_xyzw = np.zeros((0, 4))
        self._live: dict[int, int] = {}
        self._rows_known: tuple[Roster, Array] | None = None

    @property
    def living(self) -> tuple[int, ...]:
        """Codes (`frames.encode`) of the links whose records go on."""
        return tuple(self._live)

    def index_of(self, code: int) -> int:
        """Index of the living record of a link, or -1."""
        return self._live.get(code, -1)

    def of_row(self, roster: Roster) -> Array:
        """(n,) index of the living record of each row of the roster, or -1."""
        if self._rows_known is None or self._rows_known[0] is not roster:
            of_row = np.array([self._live.get(int(code), -1) for code in roster.code], np.int64)
            self._rows_known = roster, of_row
        return self._rows_known[1]

    def append(self, code: int, record: Body, position_m: Array, quaternion_xyzw: Array) -> None:
        """Begin a link's record, where it stands."""
        self._live[code] = len(self.bodies)
        self._rows_known = None
        self.bodies.append(record)
        self.position_m = np.concatenate([self.position_m, position_m[None]])
        self.quaternion_xyzw = np.concatenate([self.quaternion_xyzw, quaternion_xyzw[None]])

    def close(self, codes: Iterable[int], until_step: int) -> None:
        """End the living records of links with a step; links without one are passed over."""
        for code in codes:
            if code in self._live:
                index = self._live.pop(code)
                self.bodies[index] = replace(self.bodies[index], until_step=until_step)
        self._rows_known = None
