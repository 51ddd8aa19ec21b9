"""Steps of a contact log as columns, in memory and on disk, for logs of hours.

Step -> StepLog -> LOGGED_STEP row + rows of LOGGED_POSE, CONTACT, LINK_MOTION (spools) -> LogSteps -> Step, on request
npz  -> the same four tables, read from the file (step_entries) -> LogSteps -> Step

LOGGED_STEP     length, gravity, and the end of its rows among all poses, contacts and motions
LOGGED_POSE     index of the body into the log's `bodies`, moved by hand or not, position, quaternion
CONTACT         records.contacts
LINK_MOTION     records.touching.link_motions
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np

from sonic_bullet.files.storage.spool import Spool
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import join_arrays
from sonic_bullet.records.contacts import CONTACT, Contacts, Step, first_bodies
from sonic_bullet.records.step_tables import StepTables, group_steps
from sonic_bullet.records.touching.link_motions import LINK_MOTION

ROW_KINDS = ("pose", "contact", "motion")
"""Tables whose rows belong to steps."""
LOGGED_STEP = np.dtype([("dt_s", "f8"), ("gravity_m_s2", "f8", (3,)), *((f"{kind}_end", "i8") for kind in ROW_KINDS)])
LOGGED_POSE = np.dtype(
    [("body", "i4"), ("teleported", "?"), ("position_m", "f8", (3,)), ("quaternion_xyzw", "f8", (4,))], align=True
)
PACKED = 64
"""Steps that wait before they are packed: one call for 64 costs a fifth of 64 calls."""
BLOCK_STEPS, BLOCK_ROWS = 256, 1 << 16
"""Steps that are read at once, and the rows that end a block before: 10 MB of contacts."""


class Table(Protocol):
    """Rows (·,) of one dtype that are read on request: a `Spool`, an array, entries of a file."""

    def __len__(self) -> int:
        """Return the number of rows."""

    def __getitem__(self, rows: slice, /) -> Array:
        """Read rows."""


class StepBlock(NamedTuple):
    """Consecutive steps with all their rows in memory.

    Parameters
    ----------
    step, pose, contact, motion : Array of LOGGED_STEP, LOGGED_POSE, CONTACT, LINK_MOTION
        The ends in step count from this block's first rows.
    """

    step: Array
    pose: Array
    contact: Array
    motion: Array

    def counts(self, name: str) -> Array:
        """Return the rows (n,) of each step; name: of `ROW_KINDS`."""
        return np.diff(self.step[f"{name}_end"], prepend=0)

    def tables(self) -> Iterator[StepTables]:
        """Iterate over the block's steps as tables, as many at once as are of the same bodies."""
        columns = tuple(_column(self.pose, name) for name in ("position_m", "quaternion_xyzw", "teleported"))
        body, gravity, dt_s = self.pose["body"].astype(np.int64), _column(self.step, "gravity_m_s2"), self.step["dt_s"]
        count, ends = self.counts("pose"), {kind: self.step[f"{kind}_end"].tolist() for kind in ROW_KINDS}
        other = np.ones(len(count) + 1, bool)  # bodies than the step before; behind the last, too
        for i in (np.flatnonzero(count[1:] == count[:-1]) + 1).tolist():
            here = ends["pose"][i] - count[i]
            other[i] = (body[here - count[i] : here] != body[here : here + count[i]]).any()
        first = 0
        for stop in (np.flatnonzero(other[1:]) + 1).tolist():
            before = {kind: end[first - 1] if first else 0 for kind, end in ends.items()}
            poses, b = slice(before["pose"], ends["pose"][stop - 1]), int(count[first])
            who = body[poses][:b]
            usual = first_bodies(b)
            motions: tuple[Array, ...] = ()
            if ends["motion"][stop - 1] > before["motion"]:
                edges = [before["motion"], *ends["motion"][first:stop]]
                motions = tuple(self.motion[low:high] for low, high in pairwise(edges))
            position_m, quaternion_xyzw, teleported = (one[poses] for one in columns)
            yield StepTables(
                tuple(dt_s[first:stop].tolist()),
                gravity[first:stop],
                self.contact[before["contact"] : ends["contact"][stop - 1]],
                tuple(end - before["contact"] for end in ends["contact"][first:stop]),
                position_m.reshape(stop - first, b, 3),
                quaternion_xyzw.reshape(stop - first, b, 4),
                teleported.reshape(stop - first, b),
                usual if np.array_equal(who, usual) else who,
                motions,
            )
            first = stop

    def steps(self) -> list[Step]:
        """Make the block's steps, whose numbers were checked before."""
        made, p0, k0, m0 = [], 0, 0, 0
        position, turned, moved, body = (
            _column(self.pose, name) for name in ("position_m", "quaternion_xyzw", "teleported", "body")
        )
        gravity, none = _column(self.step, "gravity_m_s2"), Contacts.none()
        body = body.astype(np.int64)
        body.flags.writeable = False
        columns = (self.step[name].tolist() for name in ("dt_s", *(f"{kind}_end" for kind in ROW_KINDS)))
        for i, (dt_s, p1, k1, m1) in enumerate(zip(*columns, strict=True)):
            rows = Contacts.of_trusted(self.contact[k0:k1]) if k1 > k0 else none
            # ascending from 0, so that the last tells whether it is the first p1 - p0
            usual = p1 == p0 or body[p1 - 1] == p1 - p0 - 1
            who = first_bodies(p1 - p0) if usual else body[p0:p1]
            step = Step.of_trusted(dt_s, position[p0:p1], turned[p0:p1], moved[p0:p1], rows, gravity[i], who)
            made.append(step.with_motions(self.motion[m0:m1]) if m1 > m0 else step)
            p0, k0, m0 = p1, k1, m1
        return made


def _column(table: Array, name: str) -> Array:
    """Copy a field, contiguous and read-only; a flag of a file is true by any byte but 0, and becomes NumPy's own."""
    made = np.ascontiguousarray(table[name])
    made = made.view(np.uint8) != 0 if made.dtype == bool else made
    made.flags.writeable = False
    return made


@dataclass(frozen=True, slots=True, eq=False)
class LogSteps(Sequence[Step]):
    """Steps start … stop-1 of four tables, made on request, as are slices.

    Parameters
    ----------
    step, pose, contact, motion
        Tables of LOGGED_STEP, LOGGED_POSE, CONTACT, LINK_MOTION; they may grow beyond ``stop``.
    known
        More than the largest index of a body in the tables.
    """

    step: Table
    pose: Table
    contact: Table
    motion: Table
    start: int
    stop: int
    known: int
    _last: list[Any]

    @classmethod
    def of(cls, steps: Sequence[Step]) -> LogSteps:
        """Pack steps that are in memory; FileError where they outgrow memory and disk."""
        kept = StepLog()
        for step in steps:
            kept.append(step)
        return kept.steps()

    def __len__(self) -> int:
        """Return the number of steps."""
        return self.stop - self.start

    def __getitem__(self, index: Any) -> Any:
        """Return a step, or the steps of a slice."""
        if isinstance(index, slice):
            start, stop, stride = index.indices(len(self))
            if stride != 1:
                return tuple(self[i] for i in range(start, stop, stride))
            first = self.start + start
            return replace(self, start=first, stop=max(first, self.start + stop), _last=[0, ()])
        number = range(len(self))[index] + self.start
        first, steps = self._last
        if not first <= number < first + len(steps):
            # whole blocks from the start, so that going backwards costs no more
            first = number - (number - self.start) % BLOCK_STEPS
            steps = [one for block in self._blocks(first, min(first + BLOCK_STEPS, self.stop)) for one in block.steps()]
            self._last[:] = first, steps
        return steps[number - first]

    def __iter__(self) -> Iterator[Step]:
        """Iterate over the steps."""
        for block in self.blocks():
            yield from block.steps()

    def tables(self) -> Iterator[StepTables]:
        """Iterate over the steps as tables, as many at once as are of the same bodies and in one block."""
        return (tables for block in self.blocks() for tables in block.tables())

    def blocks(self) -> Iterator[StepBlock]:
        """Iterate over the blocks."""
        return self._blocks(self.start, self.stop)

    def _blocks(self, first: int, stop: int) -> Iterator[StepBlock]:
        while first < stop:
            before = self._before(first)
            step = self.step[first : min(first + BLOCK_STEPS, stop)].copy()
            for kind, rows in zip(ROW_KINDS, before, strict=True):
                step[f"{kind}_end"] -= rows
            most = np.max([step[f"{kind}_end"] for kind in ROW_KINDS], axis=0)
            step = step[: max(1, int(np.searchsorted(most, BLOCK_ROWS, side="right")))]
            yield StepBlock(
                step,
                *(
                    getattr(self, kind)[rows : rows + int(step[f"{kind}_end"][-1])]
                    for kind, rows in zip(ROW_KINDS, before, strict=True)
                ),
            )
            first += len(step)

    def _before(self, number: int) -> tuple[int, ...]:
        """Count the rows of each of `ROW_KINDS` before a step."""
        if number == 0:
            return (0,) * len(ROW_KINDS)
        (row,) = self.step[number - 1 : number]
        return tuple(int(row[f"{kind}_end"]) for kind in ROW_KINDS)

    def lengths_s(self) -> Array:
        """Return the length (n,) of each step."""
        return np.concatenate([np.zeros(0), *(rows["dt_s"] for rows in self.step_rows())])

    def step_rows(self) -> Iterator[Array]:
        """Iterate over LOGGED_STEP rows alone, many at once; their ends count from the tables' first rows."""
        for first in range(self.start, self.stop, BLOCK_ROWS):
            yield self.step[first : min(first + BLOCK_ROWS, self.stop)]

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the steps by value."""
        return LogSteps.of, (tuple(self),)  # by value: another process has neither the spool nor the file

    @property
    def rows_before(self) -> tuple[int, ...]:
        """Number of rows of each of `ROW_KINDS` in the tables before the first step."""
        return self._before(self.start)

    @property
    def row_counts(self) -> tuple[int, ...]:
        """Number of rows of each of `ROW_KINDS` of the steps."""
        return tuple(np.subtract(self._before(self.stop), self.rows_before).tolist())

    def bodies(self) -> int:
        """Return one more than the largest index of a body that has a pose."""
        return max((int(block.pose["body"].max(initial=-1)) + 1 for block in self.blocks()), default=0)


class StepLog:
    """Packs steps into tables as they arrive."""

    def __init__(self, instead: str = "") -> None:
        self._tables = tuple(
            Spool(dtype, what="contact log", instead=instead)
            for dtype in (LOGGED_STEP, LOGGED_POSE, CONTACT, LINK_MOTION)
        )
        self._fresh: list[Step | StepTables] = []
        self._waiting = 0
        self._known = 0
        self._lock = threading.Lock()

    def append(self, steps: Step | StepTables) -> None:
        """Append a step, or several; FileError where the disk takes no more, with the steps stored."""
        with self._lock:
            self._fresh.append(steps)
            self._waiting += len(steps) if isinstance(steps, StepTables) else 1
            if self._waiting < PACKED:
                return
            self._pack()
            for table in self._tables:
                table.spill()

    def steps(self) -> LogSteps:
        """Return the steps so far, without later ones."""
        with self._lock:
            self._pack()
        step, pose, contact, motion = self._tables
        return LogSteps(step, pose, contact, motion, 0, len(step), self._known, [0, ()])

    def _pack(self) -> None:
        fresh = group_steps(self._fresh)
        if not fresh:
            return
        steps, *tables = self._tables
        counts = np.concatenate([_row_counts(one) for one in fresh], axis=1)
        step, pose = np.zeros(counts.shape[1], LOGGED_STEP), np.zeros(int(counts[0].sum()), LOGGED_POSE)
        step["dt_s"] = [dt_s for one in fresh for dt_s in one.dt_s]
        step["gravity_m_s2"] = np.concatenate([one.gravity_m_s2 for one in fresh])
        for kind, table, count in zip(ROW_KINDS, tables, counts, strict=True):
            step[f"{kind}_end"] = len(table) + np.cumsum(count)
        for name in ("teleported", "position_m", "quaternion_xyzw"):
            tail = LOGGED_POSE[name].shape
            pose[name] = np.concatenate([getattr(one, name).reshape(-1, *tail) for one in fresh])
        pose["body"] = np.concatenate([np.tile(one.body, len(one)) for one in fresh])
        self._known = max(self._known, int(pose["body"].max(initial=-1)) + 1)
        steps.append(step)
        contacts = join_arrays([one.contact for one in fresh], CONTACT)
        motions = [rows for one in fresh for rows in one.motions]
        for table, rows in zip(tables, (pose, contacts, join_arrays(motions, LINK_MOTION)), strict=True):
            table.append(rows)
        self._fresh, self._waiting = [], 0  # last: an interrupt loses nothing


def _row_counts(tables: StepTables) -> Array:
    """Count the rows (3, s) of each of `ROW_KINDS` of steps."""
    motions = [len(rows) for rows in tables.motions] or [0] * len(tables)
    contacts = np.diff(tables.contact_end, prepend=0)
    return np.array([[len(tables.body)] * len(tables), contacts, motions], np.int64)
