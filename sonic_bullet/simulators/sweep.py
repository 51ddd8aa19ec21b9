"""Contacts of the last steps, by which the engine recognises a contact (src/listener/surface_sweep.hpp)."""

from __future__ import annotations

import numpy as np

from sonic_bullet._engine import MEMORY_STEPS, TRACE
from sonic_bullet.records import Array

__all__ = ["TRACE"]


class Traces:
    """Contacts of the last MEMORY_STEPS steps, in a ring of one table more.

    Attributes
    ----------
    table : Array of TRACE, shape (MEMORY_STEPS + 1, capacity)
    count
        Contacts of each table.
    newest
        Table of the coming step.
    sorting : Array, shape (3, capacity)
        Scratch.
    """

    def __init__(self) -> None:
        self.table: Array = np.zeros((MEMORY_STEPS + 1, 0), TRACE)
        self.count = np.zeros(MEMORY_STEPS + 1, np.int64)
        self.newest = 0
        self.sorting: Array = np.zeros((3, 0), np.int64)

    def clear(self) -> None:
        """Forget all contacts."""
        self.count[:] = 0

    def reserve(self, rows: int) -> None:
        """Make space for that many contacts in a step."""
        if rows > self.table.shape[1]:
            grown = np.zeros((len(self.table), 2 * rows), TRACE)
            grown[:, : self.table.shape[1]] = self.table
            self.table, self.sorting = grown, np.zeros((3, 2 * rows), np.int64)

    def turn(self) -> None:
        """Advance the ring by a step; the oldest table is reused."""
        self.newest = (self.newest - 1) % len(self.count)
