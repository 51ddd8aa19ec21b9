r"""Contacts, steps and events of a simulation as values.

`Contacts` (rows of one step), `Step`, `Event`, and the `ContactLog` they add up to.

    getContactPoints -> Contacts -> Step -> synthesizer (live)      -> frame
                                      \-> ContactLog -> npz -> Step -> the same synthesizer (replay) -> the same bits

k rows, s steps, b bodies. A row's a and b are indices into the log's `bodies`; its impulse acts on a, its negative on
b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import _engine
from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.arrays import LARGEST_SI, join_arrays
from sonic_bullet.records.coerce import as_items, as_kind, as_number, quote
from sonic_bullet.records.errors import LogError, RecordError
from sonic_bullet.records.touching.link_motions import NO_MOTIONS, as_motions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

CONTACT = _engine.CONTACT
"""One contact: 20 numbers of 8 bytes, both indices in the first; see `Contacts`."""

ROW_FIELDS: dict[str, tuple[type, tuple[int, ...]]] = {
    "a": (np.int32, ()),
    "b": (np.int32, ()),
    "point_a_m": (float, (3,)),
    "point_b_m": (float, (3,)),
    "normal": (float, (3,)),
    "impulse_n_s": (float, (3,)),
    "slip_m_s": (float, (3,)),
    "sweep_m_s": (float, (2,)),
    "approach_m_s": (float, ()),
    "gap_m": (float, ()),
}
"""The same fields one by one, as files hold them: dtype and shape of a row."""


SHORTEST_STEP_S, LONGEST_STEP_S = 1e-9, 1.0
"""Of a physics step. The shortest is 1/2600 of a sample at the highest rate, 384 kHz; below it, motions divided by a
step lose their digits, and the poles of what is held within it are no numbers."""
UNIT_QUATERNION = 0.1
"""Deviation of a quaternion's length from 1 that is taken for rounding, or for keys that were blended linearly."""


def as_step_length(dt_s: object) -> float:
    """Return the length of a physics step in s; LogError where none can be so long."""
    remedy = "set a time step of 1 ns to 1 s with setTimeStep"
    least, most = SHORTEST_STEP_S, LONGEST_STEP_S
    return as_number(dt_s, "dt_s of a physics step", remedy, least=least, most=most, error=LogError)


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Contacts:
    """The loaded contacts of one step, one row each: `row` (k,) of CONTACT, read-only.

    Parameters
    ----------
    a, b : Array, shape (k,)
        Indices of bodies.
    point_a_m, point_b_m : Array, shape (k, 3)
        The contact in either body's frame, by the pose before the step.
    normal : Array, shape (k, 3)
        Unit, world frame, from b to a.
    impulse_n_s : Array, shape (k, 3)
        World frame, on a, friction included.
    slip_m_s : Array, shape (k, 3)
        Tangential velocity of a's material relative to b's, world frame, before the step.
    sweep_m_s : Array, shape (k, 2)
        Speed at which the contact moves over a's and over b's surface.
    approach_m_s : Array, shape (k,)
        Closing speed before the step, positive when nearing.
    gap_m : Array, shape (k,)
        Distance before the step, negative when overlapping.
    """

    row: Array

    def __init__(
        self,
        a: ArrayLike,
        b: ArrayLike,
        *,
        point_a_m: ArrayLike,
        point_b_m: ArrayLike,
        normal: ArrayLike,
        impulse_n_s: ArrayLike,
        slip_m_s: ArrayLike,
        sweep_m_s: ArrayLike,
        approach_m_s: ArrayLike,
        gap_m: ArrayLike,
    ) -> None:
        given = (a, b, point_a_m, point_b_m, normal, impulse_n_s, slip_m_s, sweep_m_s, approach_m_s, gap_m)
        remedy = "give indices of bodies (k,)"
        k = np.shape(a)[0] if isinstance(a, np.ndarray) and a.ndim else len(as_items(a, "contact a", remedy))
        row = np.empty(k, CONTACT)
        for (name, (dtype, tail)), column in zip(ROW_FIELDS.items(), given, strict=True):
            row[name] = frozen_array(column, dtype, (k, *tail), f"contact {name}")
        row.setflags(write=False)
        object.__setattr__(self, "row", row)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.row)

    @property
    def a(self) -> Array:
        """Indices of the first bodies (k,)."""
        return self.row["a"]

    @property
    def b(self) -> Array:
        """Indices of the second bodies (k,)."""
        return self.row["b"]

    @property
    def point_a_m(self) -> Array:
        """Contact points in a's frame (k, 3)."""
        return self.row["point_a_m"]

    @property
    def point_b_m(self) -> Array:
        """Contact points in b's frame (k, 3)."""
        return self.row["point_b_m"]

    @property
    def normal(self) -> Array:
        """Unit normals from b to a (k, 3), world frame."""
        return self.row["normal"]

    @property
    def impulse_n_s(self) -> Array:
        """Impulses on a (k, 3), world frame."""
        return self.row["impulse_n_s"]

    @property
    def slip_m_s(self) -> Array:
        """Slip velocities (k, 3), world frame."""
        return self.row["slip_m_s"]

    @property
    def sweep_m_s(self) -> Array:
        """Speeds of the contact over a's and b's surfaces (k, 2)."""
        return self.row["sweep_m_s"]

    @property
    def approach_m_s(self) -> Array:
        """Closing speeds (k,)."""
        return self.row["approach_m_s"]

    @property
    def gap_m(self) -> Array:
        """Distances (k,), negative when overlapping."""
        return self.row["gap_m"]

    @classmethod
    def of(cls, row: Array) -> Contacts:
        """Build contacts of rows (k,) of CONTACT.

        Raises
        ------
        RecordError
            They are not such rows, or a number is NaN or beyond `LARGEST`.
        """
        if not isinstance(row, np.ndarray) or row.dtype != CONTACT or row.ndim != 1:
            raise RecordError(f"contacts: row is {quote(row)}", "pass an array (k,) of dtype CONTACT")
        kept = not row.flags.writeable and row.base is None and row.flags.c_contiguous
        row = row if kept else np.array(row, CONTACT)
        number = row.view(np.float64).reshape(len(row), CONTACT.itemsize // 8)[:, 1:]
        # False for NaN too
        if not (number.max(initial=0) <= LARGEST_SI and number.min(initial=0) >= -LARGEST_SI):
            return cls(**{name: row[name] for name in ROW_FIELDS})  # which names the field
        row.setflags(write=False)
        return cls.of_trusted(row)

    @classmethod
    def of_trusted(cls, row: Array) -> Contacts:
        """Wrap rows that were checked before and are no longer modified, without checks or copies."""
        made = object.__new__(cls)
        object.__setattr__(made, "row", row)
        return made

    @classmethod
    def none(cls) -> Contacts:
        """Return contacts without rows."""
        return _NONE

    @classmethod
    def join(cls, parts: Sequence[Contacts]) -> Contacts:
        """Join the rows of all parts, in order."""
        return cls.of_trusted(join_arrays([part.row for part in parts], CONTACT))

    def rows(self, start: int, stop: int) -> Contacts:
        """Return rows start … stop-1."""
        return Contacts.of_trusted(self.row[start:stop])


def _no_rows() -> Contacts:
    row = np.empty(0, CONTACT)
    row.setflags(write=False)
    return Contacts.of_trusted(row)


_NONE = _no_rows()


@lru_cache(maxsize=256)
def first_bodies(count: int) -> Array:
    """Return indices 0 … count-1, those of a step while no body was removed; the same array each time."""
    made = np.arange(count, dtype=np.int64)
    made.setflags(write=False)
    return made


_FIRST = np.zeros(0, np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One physics step: its length, the poses at its start of all bodies known by then, and its loaded contacts.

    Parameters
    ----------
    position_m, quaternion_xyzw : Array, shapes (b, 3), (b, 4)
        Body frames in the world.
    teleported : Array of bool, shape (b,)
        True where the body was moved by hand since the previous step.
    gravity_m_s2 : Array, shape (3,)
        World frame; a body that falls for one step gains that speed, which is no impact (see contact.load_splitting).
    body : Array, shape (b,)
        Ascending indices of these bodies into the log's `bodies`, by default the first b; a removed body never returns.
    motions : Array of LINK_MOTION, shape (r,)
        How links of jointed bodies move from this step on, where it is known anew; see `records.touching.link_motions`.
    """

    dt_s: float
    position_m: Array
    quaternion_xyzw: Array
    teleported: Array
    contacts: Contacts
    gravity_m_s2: Array = field(default_factory=lambda: np.zeros(3))
    body: Array = field(default_factory=lambda: _FIRST)
    motions: Array = field(default_factory=lambda: NO_MOTIONS)

    if TYPE_CHECKING:  # what may be passed: the fields hold read-only arrays of it

        def __init__(
            self,
            dt_s: float,
            position_m: ArrayLike,
            quaternion_xyzw: ArrayLike,
            teleported: ArrayLike,
            contacts: Contacts,
            gravity_m_s2: ArrayLike = ...,
            body: ArrayLike = ...,
            motions: Array = ...,
        ) -> None: ...

    def __post_init__(self) -> None:
        """Check the fields."""
        object.__setattr__(self, "position_m", frozen_array(self.position_m, float, (None, 3), "step: position_m"))
        b = len(self.position_m)
        object.__setattr__(
            self, "quaternion_xyzw", frozen_array(self.quaternion_xyzw, float, (b, 4), "step: quaternion_xyzw")
        )
        object.__setattr__(self, "teleported", frozen_array(self.teleported, bool, (b,), "teleported"))
        object.__setattr__(self, "gravity_m_s2", frozen_array(self.gravity_m_s2, float, (3,), "step: gravity_m_s2"))
        object.__setattr__(self, "dt_s", as_step_length(self.dt_s))
        as_kind(
            self.contacts, Contacts, "step: contacts", "give Contacts, of no rows where nothing touches", error=LogError
        )
        if self.body is _FIRST:
            object.__setattr__(self, "body", first_bodies(b))
        body = frozen_array(self.body, np.int64, (b,), "step: body")
        object.__setattr__(self, "body", body if self.body is not first_bodies(b) else self.body)
        if b and (body[0] < 0 or (np.diff(body) <= 0).any()):
            raise LogError("step: body: its indices do not ascend from 0", "use an unbroken contact log")
        if not (np.isin(self.contacts.a, body).all() and np.isin(self.contacts.b, body).all()):
            raise LogError("a contact names a body that the step does not know", "use an unbroken contact log")
        object.__setattr__(self, "motions", as_motions(self.motions, body))

    @classmethod
    def of_trusted(
        cls,
        dt_s: float,
        position_m: Array,
        quaternion_xyzw: Array,
        teleported: Array,
        contacts: Contacts,
        gravity_m_s2: Array,
        body: Array | None = None,
    ) -> Step:
        """Build a step of numbers checked before, in arrays that are no longer modified, without checks or copies.

        The arrays become read-only. body None: the first b.
        """
        made = object.__new__(cls)
        for array in (position_m, quaternion_xyzw, teleported, gravity_m_s2):
            array.flags.writeable = False
        who = first_bodies(len(position_m)) if body is None else body
        numbers = dt_s, position_m, quaternion_xyzw, teleported, contacts, gravity_m_s2, who, NO_MOTIONS
        for put, value in zip(_PUT, numbers, strict=True):
            put(made, value)
        return made

    def with_motions(self, motions: Array) -> Step:
        """Return the step with rows of LINK_MOTION checked before."""
        made = Step.of_trusted(*(getattr(self, name) for name in STEP_FIELDS[:-1]))
        object.__setattr__(made, "motions", motions)
        return made


STEP_FIELDS = tuple(one.name for one in fields(Step))
_PUT = tuple(vars(Step)[name].__set__ for name in STEP_FIELDS)
"""Setters of the slots: the way of a frozen record round its own, in half the time."""


@dataclass(frozen=True, slots=True)
class Event:
    """An event between two physics steps that is not a contact.

    A quench changes the sound; the others explain why contacts differ, and act by the poses of the steps.

    Parameters
    ----------
    kind
        "quench", all vibration stops; "reset", the world was emptied (resetSimulation); "moved", a body was set
        elsewhere by hand, and had not been before the step before.
    step
        Number of the step before which it happened; it acts at that step's first sample, whatever the rate.
    body
        Index into the log's `bodies` of the body moved; None: all bodies.

    Raises
    ------
    LogError
        This version does not know the kind; ignoring it would change the sound of the log.
    """

    kind: str
    step: int
    body: int | None = None

    def __post_init__(self) -> None:
        """Check the fields."""
        event_kinds = ("quench", "reset", "moved")
        if self.kind not in event_kinds:
            raise LogError(f"an event of the unknown kind '{self.kind[:40]}'", "use the version that wrote the log")
        if self.step < 0:
            raise LogError(f"an event before step {self.step}", "use an unbroken contact log")
        of_one_body = ("moved",)  # kinds of event that concern one body; the others concern all
        if (self.body is None) == (self.kind in of_one_body):
            who = "of no body" if self.body is None else f"of body {self.body} alone"
            raise LogError(f"an event '{self.kind}' {who}", "use the version that wrote the log")
        if self.body is not None and self.body < 0:
            raise LogError(f"an event of body {self.body}", "use an unbroken contact log")
