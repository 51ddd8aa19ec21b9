"""Groups of tables: the flat tuple that the driver takes, and the groups that it makes of it, agree name by name."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np
import pytest

from sonic_bullet.bank import BankState
from sonic_bullet.machine.compiled import njit
from sonic_bullet.machine.grouping import gather, grouping, kinds_of
from sonic_bullet.path.propagation import PathState
from sonic_bullet.records import Air, Microphone
from sonic_bullet.runtime.groups import DriverCall, Frames, Groups, StepTables
from sonic_bullet.runtime.synthesis_state import Setup, State, TouchingPairs, Window, start
from sonic_bullet.runtime.tables import StepScratch


class Low(NamedTuple):
    """Two scalars, of one type."""

    a: int
    b: int


class High(NamedTuple):
    """An array and a scalar."""

    c: np.ndarray
    d: float


class Both(NamedTuple):
    """Two groups."""

    low: Low
    high: High


grouped = grouping(Both)


@njit(nogil=True)
def named(values):  # type: ignore[no-untyped-def]
    both = grouped(values)
    both.high.c[0] = 7.0
    return both.low.a, both.low.b, both.high.c[1], both.high.d


def state_of() -> State:
    return start(Setup(48_000, (Microphone(np.zeros(3)),), 0, Air()))


def is_same(value: Any, other: Any) -> bool:
    """Whether arrays are the same memory, or numbers equal."""
    if isinstance(value, np.ndarray):
        return bool(value.__array_interface__ == other.__array_interface__)
    return bool(value == other)


def test_a_kernel_finds_each_value_under_the_name_of_its_field() -> None:
    values, array = gather(Low, {}, Low(b=2, a=1)), np.arange(2.0)
    assert named((*values, *High(d=4.5, c=array))) == (1, 2, 1.0, 4.5)
    assert array[0] == 7.0  # the same memory


def test_a_kernel_refuses_other_counts() -> None:
    with pytest.raises(Exception, match="3 values for 4 fields of Both"):
        named((1, 2, np.zeros(1)))


def test_values_of_the_state_stand_in_the_order_of_the_groups_fields() -> None:
    """The first three groups are the call's, all others the state's: each value is the attribute of that name."""
    state, kinds = state_of(), kinds_of(Groups)
    assert tuple(kinds) == Groups._fields and list(kinds.values())[:3] == [DriverCall, StepTables, Frames]
    values = iter(state.tables())
    holders = {
        "window": [state.window, state.images], "table": [state.table], "pairs": [state.pairs], "supports": [state],
        "bank": [state.ringing, state.bank], "scratch": [state.scratch], "path": [state.path, state.travelling],
    }  # fmt: skip
    checked = 0
    for name in Groups._fields[3:]:
        for field in kinds[name]._fields:
            held = [getattr(one, field) for one in holders[name] if hasattr(one, field)]
            value = next(values)
            assert is_same(value, held[0]), (name, field)
            checked += 1
    assert next(values, None) is None and checked == 66


def test_tables_stay_in_c_order_as_bodies_come_and_go() -> None:
    """A table in another order is another type to the compiled driver, which would be compiled anew for it."""
    window = state_of().window
    for count in (1, 3, 4):
        window.with_bodies(np.ones((count, 3)), np.ones((count, 4)))
        assert all(getattr(window, one.name).flags.c_contiguous for one in fields(window))
    window.subset(np.array([0, 2, 5]), np.arange(8))
    assert all(getattr(window, one.name).flags.c_contiguous for one in fields(window))


def test_no_table_is_left_out() -> None:
    kinds = kinds_of(Groups)
    for name, kept, own in (
        ("window", Window, set()),
        ("pairs", TouchingPairs, set()),
        ("scratch", StepScratch, {"samples"}),
        ("bank", BankState, {"at"}),
        ("path", PathState, {"at"}),
    ):
        assert {field.name for field in fields(kept)} - own <= set(kinds[name]._fields), name
