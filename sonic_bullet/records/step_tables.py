"""Consecutive steps of the same bodies as tables: how many at once are stored and sound.

Step, Step, … -> StepTables.of ┐
a world's steps that wait -----┴-> StepTables -> log, synthesizer        step(i) -> Step, where one is asked for
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.arrays import join_arrays
from sonic_bullet.records.contacts import CONTACT, Contacts, Step
from sonic_bullet.records.touching.link_motions import NO_MOTIONS


@dataclass(frozen=True, slots=True, eq=False)
class StepTables:
    """Steps of bodies (b,), s of them, with k contacts in all; numbers checked before, arrays no longer modified.

    Parameters
    ----------
    dt_s
        Length of each.
    gravity_m_s2 : Array, shape (s, 3)
    contact : Array of CONTACT, shape (k,)
        Rows of all steps, in order.
    contact_end
        Of each step's rows among them.
    position_m, quaternion_xyzw, teleported : Array, shapes (s, b, 3), (s, b, 4), (s, b)
        See `Step`.
    body : Array, shape (b,)
        Indices of the bodies; the same array where two tables are of the same bodies.
    motions
        Of each step; empty where no step has any.
    """

    dt_s: tuple[float, ...]
    gravity_m_s2: Array
    contact: Array
    contact_end: tuple[int, ...]
    position_m: Array
    quaternion_xyzw: Array
    teleported: Array
    body: Array
    motions: tuple[Array, ...] = ()

    @classmethod
    def of(cls, steps: Sequence[Step]) -> StepTables:
        """Join steps of the same bodies, one or more."""
        first, b, ends, end = steps[0], len(steps[0].body), [], 0
        for step in steps:
            end += len(step.contacts.row)
            ends.append(end)
        motions = tuple(step.motions for step in steps) if any(len(step.motions) for step in steps) else ()
        dt_s = tuple([step.dt_s for step in steps])
        if len(steps) == 1:
            poses = first.position_m[None], first.quaternion_xyzw[None], first.teleported[None]
            return cls(dt_s, first.gravity_m_s2[None], first.contacts.row, tuple(ends), *poses, first.body, motions)
        return cls(
            dt_s,
            join_arrays([step.gravity_m_s2 for step in steps], float, (3,)),
            join_arrays([step.contacts.row for step in steps], CONTACT),
            tuple(ends),
            join_arrays([step.position_m for step in steps], float, (b, 3)),
            join_arrays([step.quaternion_xyzw for step in steps], float, (b, 4)),
            join_arrays([step.teleported for step in steps], bool, (b,)),
            first.body,
            motions,
        )

    @classmethod
    def join(cls, parts: Sequence[StepTables]) -> StepTables:
        """Join tables of the same bodies, one or more."""
        if len(parts) == 1:
            return parts[0]
        ends, end = [], 0
        for part in parts:
            ends += [end + one for one in part.contact_end]
            end += len(part.contact)
        motions: tuple[Array, ...] = ()
        if any(part.motions for part in parts):
            motions = tuple(one for part in parts for one in part.motions or (NO_MOTIONS,) * len(part))
        return cls(
            tuple(dt_s for part in parts for dt_s in part.dt_s),
            np.concatenate([part.gravity_m_s2 for part in parts]),
            join_arrays([part.contact for part in parts], CONTACT),
            tuple(ends),
            np.concatenate([part.position_m for part in parts]),
            np.concatenate([part.quaternion_xyzw for part in parts]),
            np.concatenate([part.teleported for part in parts]),
            parts[0].body,
            motions,
        )

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.dt_s)

    def part(self, start: int, stop: int) -> StepTables:
        """Return steps start … stop - 1 as views."""
        if start == 0 and stop >= len(self.dt_s):
            return self
        before = self.contact_end[start - 1] if start else 0
        ends = self.contact_end[start:stop]
        return StepTables(
            self.dt_s[start:stop],
            self.gravity_m_s2[start:stop],
            self.contact[before : ends[-1] if ends else before],
            tuple([end - before for end in ends]) if before else ends,
            self.position_m[start:stop],
            self.quaternion_xyzw[start:stop],
            self.teleported[start:stop],
            self.body,
            self.motions[start:stop],
        )

    def step(self, i: int) -> Step:
        """Return the record of a step, -1 the last."""
        i = i % len(self.dt_s)
        before, end = self.contact_end[i - 1] if i else 0, self.contact_end[i]
        rows = self.contact[before:end]
        rows.flags.writeable = False
        made = Step.of_trusted(
            self.dt_s[i],
            self.position_m[i],
            self.quaternion_xyzw[i],
            self.teleported[i],
            Contacts.of_trusted(rows) if end > before else Contacts.none(),
            self.gravity_m_s2[i],
            self.body,
        )
        return made.with_motions(self.motions[i]) if self.motions and len(self.motions[i]) else made

    def steps(self) -> Iterator[Step]:
        """Iterate over the records."""
        return (self.step(i) for i in range(len(self)))


Steps = Sequence[Step] | StepTables
"""Consecutive steps of the same bodies."""


def as_tables(steps: Steps) -> StepTables:
    """Return steps of the same bodies as tables."""
    return steps if isinstance(steps, StepTables) else StepTables.of(steps)


def group_steps(parts: Sequence[Step | StepTables]) -> list[StepTables]:
    """Join steps and tables, in order, as far as their bodies are the same."""
    if len(parts) == 1:
        return [as_tables(part) if isinstance(part, StepTables) else StepTables.of([part]) for part in parts]
    groups: list[list[StepTables]] = []
    singles: list[Step] = []

    def close() -> None:
        if singles:
            add(StepTables.of(singles))
            singles.clear()

    def add(tables: StepTables) -> None:
        if groups and groups[-1][0].body is tables.body:
            groups[-1].append(tables)
        else:
            groups.append([tables])

    for part in parts:
        if isinstance(part, StepTables):
            close()
            add(part)
            continue
        if singles and singles[-1].body is not part.body:
            close()
        singles.append(part)
    close()
    return [StepTables.join(group) for group in groups]
