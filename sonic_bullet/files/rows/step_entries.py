"""Steps of a contact log as entries of an npz: written block by block, read from the file on request.

LogSteps -> a Column for each field                                    -> npz
npz      -> entries, large ones left in the file -> checked by blocks  -> LogSteps
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from sonic_bullet.files.rows.log_steps import (
    BLOCK_ROWS,
    LOGGED_POSE,
    LOGGED_STEP,
    ROW_KINDS,
    LogSteps,
    StepBlock,
    Table,
)
from sonic_bullet.files.storage.container import REMEDY, Column, RowsOfEntry, take
from sonic_bullet.records import Array
from sonic_bullet.records.arrays import frozen_array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.contacts import (
    CONTACT,
    LONGEST_STEP_S,
    ROW_FIELDS,
    SHORTEST_STEP_S,
    UNIT_QUATERNION,
    as_step_length,
)
from sonic_bullet.records.errors import LogError
from sonic_bullet.records.touching.link_motions import LINK_MOTION, MOTION_FIELDS, check_motions

POSE_FIELDS: dict[str, tuple[type, tuple[int, ...]]] = {
    "position_m": (float, (3,)),
    "quaternion_xyzw": (float, (4,)),
    "teleported": (bool, ()),
    "body": (np.int32, ()),
}
LAZY = (*(f"pose_{name}" for name in POSE_FIELDS), *(f"contact_{name}" for name in ROW_FIELDS))
"""Entries that may stay in the file."""
Fieldwise = Mapping[str, tuple[type, tuple[int, ...]]]


class Fields:
    """Rows of one dtype whose fields are separate arrays or entries of a file."""

    def __init__(self, dtype: np.dtype[Any], count: int, fields: Mapping[str, Array | RowsOfEntry]) -> None:
        self._dtype, self._count, self._fields = dtype, count, fields

    def __len__(self) -> int:
        """Return the number of rows."""
        return self._count

    def __getitem__(self, rows: slice) -> Array:
        """Read rows start … stop-1."""
        start, stop, _ = rows.indices(self._count)
        made = np.zeros(max(stop - start, 0), self._dtype)
        for name, field in self._fields.items():
            made[name] = field[start:stop]
        made.flags.writeable = False
        return made


def step_entries(steps: LogSteps) -> dict[str, Column]:
    """Return the columns that `write_container` writes of the steps, each read when it is written."""
    (p0, k0, m0), (p, k, m), s = steps.rows_before, steps.row_counts, len(steps)

    def of_steps(name: str) -> Iterator[Array]:
        return (rows[name] for rows in steps.step_rows())

    def counts(name: str, before: int) -> Iterator[Array]:
        for ends in of_steps(name):
            yield np.diff(ends, prepend=before)
            before = int(ends[-1])

    def parts(table: Table, name: str, first: int, stop: int) -> Iterator[Array]:
        return (table[at : min(at + BLOCK_ROWS, stop)][name] for at in range(first, stop, BLOCK_ROWS))

    def fields(kind: str, table: Table, first: int, rows: int, of: Fieldwise) -> dict[str, Column]:
        return {
            f"{kind}_{name}": Column(dtype, (rows, *tail), partial(parts, table, name, first, first + rows))
            for name, (dtype, tail) in of.items()
        }

    motions = {
        "step_motion_count": Column(np.int64, (s,), partial(counts, "motion_end", m0)),
        **fields("motion", steps.motion, m0, m, MOTION_FIELDS),
    }
    return {
        "step_dt_s": Column(float, (s,), partial(of_steps, "dt_s")),
        "step_gravity_m_s2": Column(float, (s, 3), partial(of_steps, "gravity_m_s2")),
        "step_body_count": Column(np.int64, (s,), partial(counts, "pose_end", p0)),
        "step_contact_count": Column(np.int64, (s,), partial(counts, "contact_end", k0)),
        **fields("pose", steps.pose, p0, p, POSE_FIELDS),
        **fields("contact", steps.contact, k0, k, ROW_FIELDS),
        **(motions if m else {}),
    }


def read_steps(arrays: Mapping[str, Array], names: Sequence[str], path: object) -> LogSteps:
    """Read the steps of a log of bodies of these names, every number checked, by blocks.

    Raises
    ------
    LogError
        The entries are inconsistent.
    RecordError
        A number is NaN or infinite.
    """
    dt = take(arrays, "step_dt_s", float, (None,), path)
    step = np.zeros(len(dt), LOGGED_STEP)
    most_rows = 2**40  # most poses or contacts of one step; that all their sums fit into 64 bits is checked too
    for kind, what in zip(ROW_KINDS, ("body", "contact", "motion"), strict=True):
        name, field = f"step_{what}_count", f"{kind}_end"
        if kind == "motion" and name not in arrays:  # nothing jointed is listened to
            continue
        count = take(arrays, name, np.int64, (len(dt),), path)
        if (count < 0).any() or (count > most_rows).any() or count.sum(dtype=float) > 2**62:
            raise LogError(f"{path}: {name} is negative or absurd", REMEDY)
        step[field] = np.cumsum(count)
    p, k, m = (int(step[f"{kind}_end"][-1]) if len(dt) else 0 for kind in ROW_KINDS)
    gravity = take(arrays, "step_gravity_m_s2", float, (len(dt), 3), path)
    step["gravity_m_s2"] = frozen_array(gravity, float, (len(dt), 3), "step: gravity_m_s2")
    for wrong in dt[~((dt >= SHORTEST_STEP_S) & (dt <= LONGEST_STEP_S))][:1]:
        as_step_length(float(wrong))
    step["dt_s"] = dt
    # logs made before joints could be held have no decays: 0, as of free motions
    known = {name: one for name, one in MOTION_FIELDS.items() if name != "decay_per_s" or f"motion_{name}" in arrays}
    poses, contacts, motions = (
        {name: take(arrays, f"{kind}_{name}", dtype, (rows, *tail), path) for name, (dtype, tail) in fields.items()}
        for kind, rows, fields in (
            ("pose", p, POSE_FIELDS), ("contact", k, ROW_FIELDS), ("motion", m, known if m else {})
        )
    )  # fmt: skip
    step.flags.writeable = False
    tables = Fields(LOGGED_POSE, p, poses), Fields(CONTACT, k, contacts), Fields(LINK_MOTION, m, motions)
    steps = LogSteps(step, *tables, 0, len(dt), len(names), [0, ()])
    first = 0
    for block in steps.blocks():
        _check(block, len(names), path)
        _check_turns(block, first, names, path)
        first += len(block.step)
    return steps


def _check_turns(block: StepBlock, first: int, names: Sequence[str], path: object) -> None:
    """Raise LogError, with step and body, for a quaternion that is none; first: number of the block's first step."""
    length = np.linalg.norm(block.pose["quaternion_xyzw"], axis=1)
    wrong = np.flatnonzero(~(np.abs(length - 1) <= UNIT_QUATERNION))
    if len(wrong):
        row = int(wrong[0])
        step = first + int(np.searchsorted(block.step["pose_end"], row, "right"))
        found = "zero" if length[row] == 0 else f"{length[row]:.3g} long, not 1"
        what = f"the quaternion of {quote(names[block.pose['body'][row]])} in step {step} (the first is 0) is {found}"
        raise LogError(f"{path}: {what}", REMEDY)


def _check(block: StepBlock, bodies: int, path: object) -> None:
    """Raise RecordError for a wrong number, LogError where bodies do not ascend or a contact's body is absent."""
    for what, table, fields in (("step: ", block.pose, POSE_FIELDS), ("contact ", block.contact, ROW_FIELDS)):
        for name, (dtype, tail) in fields.items():
            if dtype is float:
                frozen_array(table[name], float, (len(table), *tail), what + name)
    check_motions(block.motion, path)
    number = np.arange(len(block.step))
    # one number for each body of each step, ascending throughout where each step's bodies do
    body = block.pose["body"].astype(np.int64)
    if len(body) and not 0 <= body.min() <= body.max() < bodies:
        raise LogError(f"{path}: a step has a pose of a body that the log has not", REMEDY)
    known = np.repeat(number, block.counts("pose")) * bodies + body
    if (np.diff(known) <= 0).any():
        raise LogError(f"{path}: a step's bodies do not ascend", REMEDY)
    touched = [("contact", block.contact[side]) for side in ("a", "b")]
    for kind, body in (*touched, ("motion", block.motion["body"])):
        if body.min(initial=0) < 0:
            raise LogError(f"{path}: a {kind} names a body below zero", REMEDY)
        step = np.repeat(number, block.counts(kind))
        if body.max(initial=-1) >= bodies or not np.isin(step * bodies + body, known).all():
            raise LogError(f"{path}: a {kind} names a body that the step does not know", REMEDY)
