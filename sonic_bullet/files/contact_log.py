"""Contact log: all data that a later render needs, by value.

Step (records.contacts) one after another -> ContactLog -> npz (files.logs) -> ContactLog -> render
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from sonic_bullet.files.rows.log_steps import LogSteps, StepBlock
from sonic_bullet.records import Air, Array, Body, Sensor
from sonic_bullet.records.arrays import join_arrays
from sonic_bullet.records.coerce import as_flag, as_items, as_kind, as_kinds, as_path, as_whole, quote
from sonic_bullet.records.contacts import CONTACT, Contacts, Event, Step
from sonic_bullet.records.errors import LogError
from sonic_bullet.records.simulated import Change, Values, frozen_texts, frozen_values
from sonic_bullet.records.step_tables import StepTables


@dataclass(frozen=True, slots=True, eq=False)
class ContactLog:
    """All data that a later render or comparison needs, by value.

    Parameters
    ----------
    bodies, sensors, sr, seed, air
        Bodies with their models, sensors, sample rate in Hz, and seed.
    steps
        A sequence of `Step`; stored as `LogSteps`, which makes steps, and slices of them, on request.
    untouched
        Ids of bodies that were in the world and touched nothing; known while listening, not kept in files.
    events
        Events other than contacts, in their order.
    engine
        Settings of the simulator at the first step, under its own names; a setting that is missing is not known.
    versions
        Of sonic_bullet, of the packages that its numbers depend on and of the simulator, by name.
    changes
        Later changes of engine and bodies, in order; `dynamics` and `settings` give the values at a step.
    residual
        Whether it is rendered with the residuals of materials.
    supports
        Whether it is rendered with the supports of resting bodies.
    image
        Whether it is rendered with the images of bodies in large flat faces.
    """

    bodies: tuple[Body, ...]
    steps: Sequence[Step]
    sensors: tuple[Sensor, ...]
    sr: int
    seed: int
    air: Air = field(default_factory=Air)
    untouched: frozenset[int] = frozenset()
    events: tuple[Event, ...] = ()
    engine: Values = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    changes: tuple[Change, ...] = ()
    residual: bool = True
    supports: bool = True
    image: bool = False

    def __post_init__(self) -> None:
        """Check the fields and their order."""
        ids = ("give ids of bodies",)
        checked = {
            "bodies": as_kinds(self.bodies, Body, "log: bodies", "give a tuple of Body", error=LogError),
            "steps": _as_steps(self.steps),
            "events": as_kinds(self.events, Event, "log: events", "give a tuple of Event", error=LogError),
            "sensors": as_kinds(self.sensors, Sensor, "log: sensors", "give a tuple of sensors", error=LogError),
            "air": as_kind(self.air, Air, "log: air", "give an Air", error=LogError),
            "seed": as_whole(self.seed, "log: seed", "give a whole number, 0 or more", least=0, error=LogError),
            "untouched": frozenset(
                as_whole(x, "log: untouched", *ids) for x in as_items(self.untouched, "log: untouched", *ids)
            ),
            "engine": frozen_values(self.engine, "log: engine"),
            "versions": frozen_texts(self.versions, "log: versions"),
            "changes": as_kinds(self.changes, Change, "log: changes", "give a tuple of Change", error=LogError),
            "residual": as_flag(self.residual, "log: residual"),
            "supports": as_flag(self.supports, "log: supports"),
            "image": as_flag(self.image, "log: image"),
            "sr": as_whole(self.sr, "log: sr", "give a sample rate in Hz", least=1, error=LogError),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        both: dict[str, tuple[Event | Change, ...]] = {"events": self.events, "changes": self.changes}
        for name, happened in both.items():
            if any(later.step < earlier.step for earlier, later in itertools.pairwise(happened)):
                raise LogError(f"{name} that are not in the order of their steps", "use an unbroken contact log")
            if any(one.body is not None and one.body >= len(self.bodies) for one in happened):
                raise LogError(f"{name} of a body that the log has not", "use an unbroken contact log")
        steps = self._steps
        if steps.known > len(self.bodies) < steps.bodies():  # the first is known at once
            raise LogError("a step has a pose of a body that the log has not", "use an unbroken contact log")

    def __len__(self) -> int:
        """Return the number of rows: one per contact and step."""
        return self._steps.row_counts[1]

    def __iter__(self) -> Iterator[Step]:
        """Iterate over the steps."""
        return iter(self.steps)

    @property
    def _steps(self) -> LogSteps:
        return cast(LogSteps, self.steps)

    @property
    def duration_s(self) -> float:
        """Sum of the steps' lengths."""
        return float(np.sum(self._steps.lengths_s()))

    @property
    def start_s(self) -> Array:
        """Start time of each step (s,)."""
        return np.concatenate([[0.0], np.cumsum(self._steps.lengths_s())])[: len(self.steps)]

    @property
    def rows(self) -> Contacts:
        """All rows of all steps, in order: 160 bytes each, all in memory (`blocks` are not)."""
        return Contacts.of_trusted(join_arrays([block.contact for block in self.blocks()], CONTACT))

    def tables(self) -> Iterator[StepTables]:
        """Iterate over the steps as tables, as many at once as are of the same bodies and in one block."""
        return self._steps.tables()

    def blocks(self) -> Iterator[StepBlock]:
        """Iterate over the rows of some steps at a time, in order, for logs larger than the memory."""
        return self._steps.blocks()

    @property
    def step(self) -> Array:
        """Step of each row (k,)."""
        counts = [np.zeros(0, np.int64), *(block.counts("contact") for block in self.blocks())]
        return np.repeat(np.arange(len(self.steps)), np.concatenate(counts))

    @property
    def time_s(self) -> Array:
        """Start of the step of each row (k,)."""
        return self.start_s[self.step]

    def dynamics(self, index: int, step: int = 0) -> Values:
        """Return friction, restitution, damping and mass of body ``index`` in a step, by the simulator's names.

        A value that is missing is not known.

        Raises
        ------
        LogError
            There is no such body.
        """
        index = as_whole(
            index, "index", "give an index into bodies", least=0, most=len(self.bodies) - 1, error=LogError
        )
        return self._at(step, index, self.bodies[index].dynamics)

    def settings(self, step: int = 0) -> Values:
        """Return the settings of the engine in a step; a setting that is missing is not known."""
        return self._at(step, None, self.engine)

    def _at(self, step: int, body: int | None, first: Values) -> Values:
        step = as_whole(step, "step", "give the number of a step", least=0, error=LogError)
        values: dict[str, float | None] = dict(first)
        for change in self.changes:
            if change.body == body and change.step <= step:
                values |= change.values
        return frozen_values({name: x for name, x in values.items() if x is not None}, "values")

    def impulse_on(self, body: int, link: int | None = None) -> Array:
        """Return the impulses on a body, friction included, one row per contact and step.

        Parameters
        ----------
        body
            Id; where it was reused (removal, reset), the newest body of that id.
        link
            None: all links of the body.

        Returns
        -------
        Array, shape (k, 3)
            In N·s, world frame.

        Raises
        ------
        LogError
            The log has no such body.
        """
        rows = self.rows
        sign, mask = self._side(rows, body, link)
        return np.asarray((sign[:, None] * rows.impulse_n_s)[mask])

    def rows_on(self, body: int, link: int | None = None) -> Array:
        """Return the row numbers (k,), into `rows`, `step`, `time_s`, of the impulses of `impulse_on`, in its order."""
        return np.flatnonzero(self._side(self.rows, body, link)[1])

    def _side(self, rows: Contacts, body: int, link: int | None) -> tuple[Array, Array]:
        body = as_whole(body, "body", "give a body's id", error=LogError)
        link = (
            None
            if link is None
            else as_whole(link, "link", "give a link's number, -1 the base, or None for all", error=LogError)
        )
        bearers = [i for i, x in enumerate(self.bodies) if x.body_id == body and (link is None or x.link == link)]
        if not bearers and body in self.untouched:
            return np.zeros(len(rows)), np.zeros(len(rows), bool)
        if not bearers:
            known = sorted({x.body_id for x in self.bodies})
            raise LogError(
                f"the log holds no body {quote(body)}" + ("" if link is None else f" link {quote(link)}"),
                f"known bodies: {quote(known)}",
            )
        epoch = max(self.bodies[i].epoch for i in bearers)
        bearers = [i for i in bearers if self.bodies[i].epoch == epoch]
        on_a, on_b = np.isin(rows.a, bearers), np.isin(rows.b, bearers)
        return on_a.astype(float) - on_b.astype(float), on_a ^ on_b

    def first(self, count: int) -> ContactLog:
        """Return the log of the first ``count`` steps, with events and changes up to their end."""
        return replace(
            self,
            steps=self.steps[:count],
            events=tuple(event for event in self.events if event.step <= count),
            changes=tuple(change for change in self.changes if change.step <= count),
        )

    def save(self, path: object, models: object = "included") -> None:
        """Write the log as npz (numpy arrays and JSON, no pickle), whole or not at all.

        Parameters
        ----------
        models
            "included", or "reference": a smaller file that names them, and `read_log` finds them in the cache.

        Raises
        ------
        FileError
            The file cannot be written.
        """
        from sonic_bullet.files.logs import write_log

        write_log(as_path(path, "path", "name a file, such as contacts.npz"), self, models)


def _as_steps(steps: object) -> LogSteps:
    """Convert steps to columns; LogError where they are not steps."""
    if isinstance(steps, LogSteps):
        return steps
    return LogSteps.of(as_kinds(steps, Step, "log: steps", "give a tuple of Step", error=LogError))
