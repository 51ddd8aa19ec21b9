"""What a simulation reports, step by step:

`Contacts` (rows of one step), `Step`, `Event`, and the `ContactLog` they add up to.

    getContactPoints -> Contacts -> Step -> synthesizer (live)      -> frame
                                      \\-> ContactLog -> npz -> Step -> the same synthesizer (replay) -> the same bits

k rows, s steps, b bodies. A row's a and b are indices into the log's `bodies`; its impulse acts on a, its negative on
b.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.records import Array, frozen_array
from sonic_bullet.records.coerce import as_items, as_kind, as_number
from sonic_bullet.records.errors import LogError


@dataclass(frozen=True, slots=True, eq=False)
class Contacts:
    """The loaded contacts of one step, one row each.

    a, b (k,): indices of bodies. point_a_m, point_b_m (k, 3): the contact in either body's frame, by the pose before
    the step. normal (k, 3): unit, world frame, from b to a. impulse_n_s (k, 3): world frame, on a, friction included.
    slip_m_s (k, 3): tangential velocity of a's material relative to b's, world frame, before the step. sweep_m_s (k,
    2): speed at which the contact moves over a's and over b's surface. approach_m_s (k,): closing speed before the
    step, positive when nearing. gap_m (k,): distance before the step, negative when overlapping.
    """

    a: Array
    b: Array
    point_a_m: Array
    point_b_m: Array
    normal: Array
    impulse_n_s: Array
    slip_m_s: Array
    sweep_m_s: Array
    approach_m_s: Array
    gap_m: Array

    def __post_init__(self) -> None:
        k = (
            np.shape(self.a)[0]
            if isinstance(self.a, np.ndarray) and self.a.ndim
            else len(as_items(self.a, "contact a", "give indices of bodies (k,)"))
        )
        for name, (dtype, tail) in ROW_FIELDS.items():
            object.__setattr__(self, name, frozen_array(getattr(self, name), dtype, (k, *tail), f"contact {name}"))

    def __len__(self) -> int:
        return len(self.a)

    @classmethod
    def none(cls) -> Contacts:
        """No contacts at all."""
        return cls(**{name: np.zeros((0, *tail), dtype) for name, (dtype, tail) in ROW_FIELDS.items()})

    @classmethod
    def joined(cls, parts: list[Contacts]) -> Contacts:
        """The rows of all parts, in order."""
        return (
            cls(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in ROW_FIELDS})
            if parts
            else cls.none()
        )

    def rows(self, start: int, stop: int) -> Contacts:
        """Rows start … stop-1."""
        return Contacts(**{name: getattr(self, name)[start:stop] for name in ROW_FIELDS})


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


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """One physics step: its length, the poses at its start of all bodies known by then, and its loaded contacts.

    position_m (b, 3), quaternion_xyzw (b, 4): body frames in the world; a removed body keeps its last pose. teleported
    (b,): True where the body was moved by hand since the previous step. gravity_m_s2 (3,): world frame; what falls for
    one step gains that speed, which is no impact (see synth.strikes).
    """

    dt_s: float
    position_m: Array
    quaternion_xyzw: Array
    teleported: Array
    contacts: Contacts
    gravity_m_s2: Array = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "position_m", frozen_array(self.position_m, float, (None, 3), "step: position_m"))
        b = len(self.position_m)
        object.__setattr__(
            self, "quaternion_xyzw", frozen_array(self.quaternion_xyzw, float, (b, 4), "step: quaternion_xyzw")
        )
        object.__setattr__(self, "teleported", frozen_array(self.teleported, bool, (b,), "teleported"))
        object.__setattr__(self, "gravity_m_s2", frozen_array(self.gravity_m_s2, float, (3,), "step: gravity_m_s2"))
        remedy = "set a time step between 0 and 1 s with setTimeStep"
        object.__setattr__(
            self, "dt_s", as_number(self.dt_s, "dt_s of a physics step", remedy, above=0, most=1, error=LogError)
        )
        as_kind(
            self.contacts, Contacts, "step: contacts", "give Contacts, of no rows where nothing touches", error=LogError
        )
        if len(self.contacts) and max(self.contacts.a.max(), self.contacts.b.max()) >= b:
            raise LogError("a contact names a body that the step does not know", "use an unbroken contact log")


EVENT_KINDS = ("quench",)


@dataclass(frozen=True, slots=True)
class Event:
    """What changed the sound between two physics steps without being a contact.

    kind: "quench", all that rings stops. step: the number of the step before which it happened; it acts at that step's
    first sample, whatever the rate. body: index into the log's `bodies` of the one it concerns, None: all of them (a
    quench is of all). Raises LogError for a kind that this version does not know: passed over, it would make another
    sound of the log.
    """

    kind: str
    step: int
    body: int | None = None

    def __post_init__(self) -> None:
        if self.kind not in EVENT_KINDS:
            raise LogError(f"an event of the unknown kind '{self.kind[:40]}'", "use the version that wrote the log")
        if self.step < 0:
            raise LogError(f"an event before step {self.step}", "use an unbroken contact log")
        if self.body is not None:
            raise LogError(f"a {self.kind} of body {self.body} alone", "use the version that wrote the log")
