"""Contacts as PyBullet reports them, as a table, and those of them that are loaded.

getContactPoints() -> RAW rows, packed in one pass -> TOUCH rows (`touches_of_rows`)  src/listener/loaded_contacts.hpp
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet._engine import RAW, TOUCH, load_contacts, pack_contacts
from sonic_bullet.records import Array
from sonic_bullet.simulators.frames import INVALID_BEYOND

RawContact = tuple[Any, ...]
FORCE, FRICTION_1, FRICTION_2 = 9, 10, 12

NO_RAW, NO_TOUCH = np.zeros(0, RAW), np.zeros(0, TOUCH)


@dataclass(frozen=True, slots=True, eq=False)
class Touches:
    """Loaded contacts as PyBullet reports them.

    Parameters
    ----------
    row : Array of TOUCH, shape (k,)
        code_a, code_b (k,) of frames.encode; points, normal (k, 3) world frame; gap_m (k,); impulse_n_s (k, 3) on a;
        elapsed_s (k,): from the start of the step to the start of the sub-step that loaded it.
    """

    row: Array

    def __len__(self) -> int:
        """Return the number of contacts."""
        return len(self.row)

    @property
    def code_a(self) -> Array:
        """Code of the first link (k,)."""
        return self.row["code_a"]

    @property
    def code_b(self) -> Array:
        """Code of the second link (k,)."""
        return self.row["code_b"]

    @property
    def usable(self) -> Array:
        """Mask (k,): False where a force or place is NaN or `BEYOND`."""
        number = self.row.view(np.float64).reshape(len(self.row), -1)[:, 2:]
        return np.asarray((np.abs(number) < INVALID_BEYOND).all(axis=1))

    def select(self, mask: Array) -> Touches:
        """Select the rows where mask (k,) is True."""
        return Touches(self.row[mask])

    def equals(self, other: Touches) -> bool:
        """Compare two tables, bit for bit."""
        return self.row.tobytes() == other.row.tobytes()


def pack_raw_rows(contacts: Sequence[RawContact]) -> Array:
    """Pack those contacts that carry a force into RAW rows (k,).

    Bullet lists neighbours up to 2 cm apart too. NaN counts as a force, so that it is found.
    """
    return pack_contacts(tuple(contacts)) if contacts else NO_RAW


def touches_of_rows(raw: Array, before: Array, dt_s: float) -> Touches:
    """Return the contacts of RAW rows (k,), numbers unchecked (`Touches.usable`).

    before: RAW rows reported after the step before.
    """
    touch = np.empty(len(raw), TOUCH)
    return Touches(touch[: load_contacts(raw, before, dt_s, touch)])
