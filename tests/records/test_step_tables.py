"""Steps as tables are the steps: made of records, cut, joined, and made to records again."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet.records.contacts import CONTACT, Contacts, Step
from sonic_bullet.records.step_tables import StepTables, group_steps

STEP_ARRAYS = ("position_m", "quaternion_xyzw", "teleported", "gravity_m_s2", "body", "motions")


def made(count: int, bodies: int = 2) -> list[Step]:
    """Steps with 0, 1, 2, 0, 1 … contacts."""
    rng = np.random.default_rng(bodies)
    steps = []
    for k in range(count):
        row = np.zeros(k % 3, CONTACT)
        row["b"], row["gap_m"] = 1, rng.normal(size=len(row))
        pose = rng.normal(size=(bodies, 3)), rng.normal(size=(bodies, 4)), rng.uniform(size=bodies) < 0.3
        steps.append(Step((k + 1) / 1000, *pose, Contacts.of(row), rng.normal(size=3)))
    return steps


def same(one: Step, other: Step) -> bool:
    arrays = all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in STEP_ARRAYS)
    return arrays and one.dt_s == other.dt_s and one.contacts.row.tobytes() == other.contacts.row.tobytes()


@pytest.mark.parametrize("cut", [0, 1, 3, 6, 7])
def test_tables_cut_and_joined_hold_the_steps(cut: int) -> None:
    steps = made(7)
    tables = StepTables.of(steps)
    parts = [part for part in (tables.part(0, cut), tables.part(cut, 7)) if len(part)]
    back = list(StepTables.join(parts).steps())
    assert len(back) == 7 and all(map(same, back, steps))
    assert all(
        same(one, other)
        for part, first in zip(parts, (0, cut), strict=False)
        for one, other in zip(part.steps(), steps[first if len(parts) > 1 else 0 :], strict=False)
    )
    assert same(tables.step(-1), steps[-1]) and not back[2].contacts.row.flags.writeable


def test_steps_and_tables_group_by_their_bodies_in_order() -> None:
    two, three = made(5), made(4, bodies=3)
    groups = group_steps([two[0], StepTables.of(two[1:3]), *two[3:], StepTables.of(three[:2]), *three[2:]])
    assert [len(group) for group in groups] == [5, 4]
    back = [step for group in groups for step in group.steps()]
    assert all(map(same, back, [*two, *three]))
