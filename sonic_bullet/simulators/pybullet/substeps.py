"""Contacts of every sub-step, from Bullet's contact log.

With numSubSteps > 1 getContactPoints() reports only the last sub-step (a third of the impulse at 4). The file that
startStateLogging(STATE_LOGGING_CONTACT_POINTS) writes gets one record for each contact and sub-step, and is flushed
before stepSimulation returns, so it can be read step by step. Measured format: two text lines (names, type letters
"IfIiiiifffffffffff"), then per record the mark 0xAA 0xBB and 18 little-endian 4-byte numbers. No friction, float32.

    J = h N n,  h = dt / numSubSteps        + friction in the ratio f/N that the pair had in the last sub-step

The ratio is exact for a sliding contact (Coulomb) and an estimate for a sticking one; without friction nothing is
added. resetSimulation ends the log without notice: records that stop while contacts are reported raise SceneError.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import pybullet

from sonic_bullet._engine import TOUCH
from sonic_bullet.machine.leftovers import note_leftover
from sonic_bullet.records import Array
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.frames import encode
from sonic_bullet.simulators.polling import (
    FORCE,
    FRICTION_1,
    FRICTION_2,
    NO_RAW,
    RawContact,
    Touches,
    pack_raw_rows,
    touches_of_rows,
)

SUBSTEP_REMEDY = "set numSubSteps to 0 and a smaller time step instead"
RECORD = np.dtype(
    {
        "names": ["mark", "step", "time", "flag", "body", "link", "point_a", "point_b", "normal", "gap", "force"],
        "formats": [
            "<u2",
            "<u4",
            "<f4",
            "<i4",
            ("<i4", 2),
            ("<i4", 2),
            ("<f4", 3),
            ("<f4", 3),
            ("<f4", 3),
            "<f4",
            "<f4",
        ],
    }
)


@dataclass(slots=True)
class SubstepLog:
    """An open contact log of one client: how far it was read, and the number of the next sub-step."""

    client_id: int
    path: str = ""
    handle: int = -1
    offset: int = 0
    count: int = 0
    folder: tempfile.TemporaryDirectory[str] | None = field(default=None, repr=False)

    @property
    def is_open(self) -> bool:
        """Whether a log is being written."""
        return self.handle >= 0

    def open(self) -> None:
        """Start logging into a temporary file; SceneError where no log appears."""
        self.close()
        self.folder = tempfile.TemporaryDirectory(prefix="sonic-bullet-")
        note_leftover(self.folder.name)
        self.path = os.path.join(self.folder.name, "contacts.log")
        self.handle = pybullet.startStateLogging(
            pybullet.STATE_LOGGING_CONTACT_POINTS, self.path, physicsClientId=self.client_id
        )
        self.offset = self.count = 0
        if self.handle < 0 or not os.path.exists(self.path):
            self.abandon()
            raise SceneError("numSubSteps is above 1 and Bullet's contact log cannot be written", SUBSTEP_REMEDY)

    def close(self) -> None:
        """Stop logging and remove the file; harmless when nothing is open."""
        if self.handle >= 0:
            with suppress(pybullet.error):  # the client may have gone and taken the log with it
                pybullet.stopStateLogging(self.handle, physicsClientId=self.client_id)
        self.abandon()

    def abandon(self) -> None:
        """Drop a log that Bullet has ended itself."""
        self.handle = -1
        if self.folder is not None:
            self.folder.cleanup()
            self.folder = None

    def records(self) -> Array:
        """Read the records (k,) of RECORD written since the last call; SceneError where the file is not as measured."""
        mark = 0xBBAA
        letters = b"IfIiiiifffffffffff"
        rewind_bytes = 1 << 26
        with open(self.path, "rb") as file:
            if self.offset == 0:
                header = file.readline() + file.readline()
                if not header:
                    return np.zeros(0, RECORD)
                if header.split(b"\n")[1] != letters:
                    raise SceneError(
                        "numSubSteps is above 1 and this PyBullet writes an unknown contact log", SUBSTEP_REMEDY
                    )
                self.offset = len(header)
            file.seek(self.offset)
            data = file.read()
        if len(data) % RECORD.itemsize:
            raise SceneError("numSubSteps is above 1 and Bullet's contact log ends within a record", SUBSTEP_REMEDY)
        rows = np.frombuffer(data, RECORD)
        if (rows["mark"] != mark).any():
            raise SceneError("numSubSteps is above 1 and Bullet's contact log is damaged", SUBSTEP_REMEDY)
        self.offset += len(data)
        if self.offset > rewind_bytes:
            self.open()
        return rows

    def touches(self, last: Sequence[RawContact], dt_s: float, substeps: int) -> Touches:
        """Return the loaded contacts of all sub-steps of the step just made; last: getContactPoints() of it.

        Raises
        ------
        SceneError
            The log was not open, or is not as measured.
        """
        if not self.is_open:
            self.open()
            raise SceneError(
                f"numSubSteps was set to {substeps} after listening began",
                "set it before attaching, or attach to a BulletClient, whose steps are hooked",
            )
        found, self.count = gather_substeps(self.records(), last, dt_s, substeps, self.count)
        return found


def gather_substeps(
    records: Array, last: Sequence[RawContact], dt_s: float, substeps: int, first: int
) -> tuple[Touches, int]:
    """Return the loaded contacts (k,) of all sub-steps of one step, and the number of the next sub-step.

    Parameters
    ----------
    last
        What getContactPoints() reports after the step.
    first
        Number of the step's first sub-step, corrected where `last` shows the log's newest records to be the step's last
        sub-step.

    Raises
    ------
    SceneError
        The log lacks the sub-step that `last` reports.
    """
    number = records["step"].astype(np.int64)
    if last:
        newest = number.max(initial=-1)
        if np.count_nonzero(number == newest) != len(last):
            raise SceneError(
                f"numSubSteps is {substeps} and Bullet's contact log has stopped",
                "attach again after resetSimulation, or " + SUBSTEP_REMEDY,
            )
        first = int(newest) + 1 - substeps
    h = dt_s / substeps
    touched = records["force"] != 0
    found = records[touched]
    row = np.empty(len(found), TOUCH)
    row["code_a"] = encode(found["body"][:, 0], found["link"][:, 0])
    row["code_b"] = encode(found["body"][:, 1], found["link"][:, 1])
    row["point_a_m"], row["point_b_m"], row["gap_m"] = found["point_a"], found["point_b"], found["gap"]
    row["normal"] = found["normal"]
    ratio = friction_ratio(row["code_a"], row["code_b"], last)
    row["impulse_n_s"] = h * found["force"].astype(float)[:, None] * (row["normal"] + ratio)
    row["elapsed_s"] = h * np.clip(number[touched] - first, 0, substeps - 1)
    return Touches(row), first + substeps


def friction_ratio(code_a: Array, code_b: Array, last: Sequence[RawContact]) -> Array:
    """Return friction over normal force (k, 3), world frame, of each row's pair in the last sub-step, or 0."""
    ratio = np.zeros((len(code_a), 3))
    friction = [raw for raw in last if raw[FORCE] > 0 and (raw[FRICTION_1] or raw[FRICTION_2])]
    if not friction:
        return ratio
    pressed = [raw for raw in last if raw[FORCE] > 0]
    plain = touches_of_rows(pack_raw_rows(pressed), NO_RAW, 1.0)
    impulse, normal = plain.row["impulse_n_s"], plain.row["normal"]
    along = (impulse * normal).sum(axis=1)
    for a, b in {(int(a), int(b)) for a, b in zip(plain.code_a, plain.code_b, strict=True)}:
        own = (plain.code_a == a) & (plain.code_b == b)
        tangent = (impulse[own] - along[own, None] * normal[own]).sum(axis=0) / along[own].sum()
        ratio[(code_a == a) & (code_b == b)] = tangent
    return ratio
