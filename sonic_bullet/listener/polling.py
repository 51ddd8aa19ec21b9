"""Convert PyBullet's contact tuples to a table of loaded contacts.

    getContactPoints() -> RAW rows, packed in one pass -> TOUCH rows (`load`)

    J = dt · (N n + f1 t1 + f2 t2)      on body A, world frame; -J on body B

with dt the time step set at the moment of the query: that product, and no other, balances m·Δv - m·g·dt (measured to
1e-13). Only the unfiltered getContactPoints() is right: with a body filter that swaps the pair, normal and positions
are inverted and the friction fields are not (bullet3 issues 2765, 3026). k rows.
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonic_bullet.listener.frames import INVALID_BEYOND, LINK_SPAN
from sonic_bullet.machine.compiled import njit
from sonic_bullet.records import Array

RawContact = tuple[Any, ...]
FORCE, FRICTION_1, FRICTION_2 = 9, 10, 12

RAW = np.dtype(
    [
        ("body_a", "i8"),
        ("body_b", "i8"),
        ("link_a", "i8"),
        ("link_b", "i8"),
        ("point_a_m", "f8", (3,)),
        ("point_b_m", "f8", (3,)),
        ("normal", "f8", (3,)),
        ("gap_m", "f8"),
        ("force_n", "f8"),
        ("friction_1_n", "f8"),
        ("tangent_1", "f8", (3,)),
        ("friction_2_n", "f8"),
        ("tangent_2", "f8", (3,)),
    ],
    align=True,
)
"""A contact as getContactPoints() reports it, in its order, without its first entry."""
RAW_ROW = struct.Struct("4q19d")

TOUCH = np.dtype(
    [
        ("code_a", "i8"),
        ("code_b", "i8"),
        ("point_a_m", "f8", (3,)),
        ("point_b_m", "f8", (3,)),
        ("normal", "f8", (3,)),
        ("gap_m", "f8"),
        ("impulse_n_s", "f8", (3,)),
        ("elapsed_s", "f8"),
    ],
    align=True,
)
"""A loaded contact; see `Touches`."""

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

    def kept(self, mask: Array) -> Touches:
        """Select the rows where mask (k,) is True."""
        return Touches(self.row[mask])

    def equals(self, other: Touches) -> bool:
        """Compare two tables, bit for bit."""
        return self.row.tobytes() == other.row.tobytes()


def packed(contacts: Iterable[RawContact], count: int) -> Array:
    """Pack those of `count` contacts that carry a force into RAW rows (k,).

    Bullet lists neighbours up to 2 cm apart too. NaN counts as a force, so that it is found.
    """
    buffer, at = bytearray(count * RAW_ROW.size), 0
    into, size = RAW_ROW.pack_into, RAW_ROW.size
    # one pass over the tuples without intermediate objects: half the time of columns (zip) and chains
    for (
        _, a, b, m, n, (ax, ay, az), (bx, by, bz), (nx, ny, nz), gap, force, f1, (sx, sy, sz), f2, (tx, ty, tz)
    ) in contacts:  # fmt: skip
        if force or f1 or f2:
            into(
                buffer, at, a, b, m, n, ax, ay, az, bx, by, bz, nx, ny, nz, gap, force, f1, sx, sy, sz, f2, tx, ty, tz
            )  # fmt: skip
            at += size
    return np.frombuffer(buffer, RAW, at // size) if at else NO_RAW


@njit(nogil=True, error_model="numpy")
def stale(raw, i, before):
    """Tell whether row i, without normal force, has the friction of its row in `before`, to the bit."""
    row, k = raw[i], len(before)
    for j in range(k):
        old = before[(i + j) % k]  # Bullet reports them in nearly the same order again
        if (
            old.friction_1_n == row.friction_1_n
            and old.friction_2_n == row.friction_2_n
            and old.body_a == row.body_a
            and old.body_b == row.body_b
            and old.link_a == row.link_a
            and old.link_b == row.link_b
        ):
            return True
    return False


@njit(nogil=True, error_model="numpy")
def load(raw, before, dt, touch):
    """Fill touch (k,) of TOUCH from raw (k,) of RAW and return how many are filled; numbers are not checked.

    before: RAW rows polled after the step before. A contact farther off than its contactProcessingThreshold is not
    solved. It keeps the friction of the step in which it last was, to the bit, with no normal force: that friction does
    not act. Friction without normal force that is new does act: the solver ended between the two, and without it
    momentum does not balance.
    """
    count = 0
    for i in range(len(raw)):
        row = raw[i]
        if row.force_n == 0 and stale(raw, i, before):
            continue
        made = touch[count]
        made.code_a = row.body_a * LINK_SPAN + row.link_a + 1
        made.code_b = row.body_b * LINK_SPAN + row.link_b + 1
        made.gap_m, made.elapsed_s = row.gap_m, 0.0
        for x in range(3):
            made.point_a_m[x], made.point_b_m[x], made.normal[x] = row.point_a_m[x], row.point_b_m[x], row.normal[x]
            made.impulse_n_s[x] = dt * (
                row.force_n * row.normal[x] + row.friction_1_n * row.tangent_1[x] + row.friction_2_n * row.tangent_2[x]
            )
        count += 1
    return count


@njit(nogil=True, error_model="numpy")
def all_usable(touch, count):
    """Tell whether all numbers of the first `count` contacts are within `BEYOND` and none is NaN."""
    for i in range(count):
        row = touch[i]
        if not abs(row.gap_m) < INVALID_BEYOND:
            return False
        for x in range(3):
            if not (
                abs(row.point_a_m[x]) < INVALID_BEYOND
                and abs(row.point_b_m[x]) < INVALID_BEYOND
                and abs(row.normal[x]) < INVALID_BEYOND
                and abs(row.impulse_n_s[x]) < INVALID_BEYOND
            ):
                return False
    return True


def loaded(raw: Array, before: Array, dt_s: float) -> Touches:
    """Return the contacts of RAW rows (k,), numbers unchecked (`Touches.usable`); before: as for `load`."""
    touch = np.empty(len(raw), TOUCH)
    return Touches(touch[: load(raw, before, dt_s, touch)])
