"""What a caller names is checked where it comes in: a table that would lead out of another is refused in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sonic_bullet._engine import (
    FACE,
    LINK_STATE,
    MEMORY_STEPS,
    NODE,
    START,
    TOUCH,
    TRACE,
    add_modal_impulse,
    advance_bank,
    begin_step,
    find_contact_points,
    make_contact_rows,
    nearest_points,
)
from sonic_bullet.engine.bank import Bank, BankState, ModeSet, Translation, append, empty_bank
from sonic_bullet.engine.runtime.tables import CONTACT, ROW
from sonic_bullet.records import Array
from sonic_bullet.simulators.sweep import Traces
from tests.made.banks import Strike, advance, step_scratch, tables
from tests.made.models import box_body, wall_body
from tests.made.stages import Stages, body_table

MOST_LEVELS = 63  # that a search has room for


def chain(levels: int) -> tuple[Array, Array]:
    """A tree that is as deep as it has faces: each node has a leaf and all the rest."""
    faces, nodes = np.zeros(levels, FACE), np.zeros(2 * levels - 1, NODE)
    faces["corner_m"] = np.eye(3) + 10 * np.arange(levels)[:, None, None]
    faces["normal"] = np.sqrt(1 / 3)
    for level in range(levels):
        low, high = faces["corner_m"][level:].min(axis=(0, 1)), faces["corner_m"][level:].max(axis=(0, 1))
        leaf = level == levels - 1
        nodes[2 * level] = low, high, (-level - 1, level + 1) if leaf else (2 * level + 2, 2 * level + 1)
        if not leaf:
            corner = faces["corner_m"][level]
            nodes[2 * level + 1] = corner.min(axis=0), corner.max(axis=0), (-level - 1, level + 1)
    return faces, nodes


def search(faces: Array, nodes: Array) -> int:
    """The face nearest to the middle of the last one."""
    point, face, found = faces["corner_m"][-1:].mean(axis=1), np.zeros(1, np.int64), np.zeros((1, 4))
    nearest_points(faces, nodes, 0.0, 0.0, point, np.zeros((1, 3)), face, found)
    return int(face[0])


def test_a_tree_is_as_deep_as_a_search_at_most() -> None:
    assert search(*chain(MOST_LEVELS + 1)) == MOST_LEVELS
    with pytest.raises(ValueError, match="level of a node"):
        search(*chain(MOST_LEVELS + 2))


@pytest.mark.parametrize(
    ("child", "said"),
    [((0, 1), "child: 0"), ((1, 3), "child: 3"), ((1, 1), "two parents"), ((-3, 2), "face: 2"), ((-2, 0), "face: 0")],
)
def test_a_node_names_what_is_there(child: tuple[int, int], said: str) -> None:
    faces, nodes = chain(2)
    nodes["child"][0] = child
    if child == (-3, 2):
        faces = faces[:1]
    with pytest.raises(ValueError, match=said):
        search(faces, nodes)


def touching() -> tuple[Array, Any]:
    """A row whose face is known, and the bodies."""
    table = body_table((box_body((0.3, 0.2, 0.1), (500.0, 900.0)), wall_body()))
    rows = np.zeros(1, ROW)
    rows["body"], rows["outward"], rows["touched"] = (0, 1), (0, 0, 1), 1
    rows["face"] = 0, -1
    return rows, table


@pytest.mark.parametrize(("side", "face"), [(0, 12), (0, -2), (1, 0), (0, 1 << 40)])
def test_a_face_that_a_row_knows_already_is_one_of_its_body(side: int, face: int) -> None:
    rows, table = touching()
    find_contact_points(rows, table)
    rows["face"][0, side] = face
    with pytest.raises(ValueError, match="face"):
        find_contact_points(rows, table)
    with pytest.raises(ValueError, match="face"):
        add_modal_impulse(rows, 0, side, 1.0, table, np.zeros(table.columns))


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("node_at", 1 << 40, "node_at"),
        ("shape_at", -1, "shape_at"),
        ("shape_at", 1, "vertex"),
        ("columns", 1 << 40, "vertex"),
        ("modes", -1, "modes"),
        ("turns", 1, "turns"),
        ("track_count", 1, "track_count"),
    ],
)
def test_a_body_names_what_is_there(name: str, value: int, said: str) -> None:
    rows, table = touching()
    table.bodies[name][0] = value
    with pytest.raises(ValueError, match=said):
        find_contact_points(rows, table)


def test_a_struck_body_names_frequencies_that_are_there() -> None:
    stages = Stages([box_body((0.3, 0.2, 0.1), (500.0, 900.0)), wall_body()])
    stages.number = 10
    assert stages.pulses_of(0) == 0
    stages.table.bodies["frequency_at"][0] = 1
    with pytest.raises(ValueError, match="frequency_at"):
        stages.pulses_of(0)


def a_bank() -> tuple[Bank, BankState]:
    one = ModeSet(np.array([4e3]), np.array([30.0]), np.ones((1, 1)) + 0j, translation=Translation(7000.0, 7000.0, 1.0))
    return append(*empty_bank(48_000), [one])


@pytest.mark.parametrize(
    ("start", "length_s"), [(-1.5, 1e-3), (-1e9, 2e6), (np.nan, 1e-3), (0.5, np.nan), (0.5, -1.0), (1e18, 1e-3)]
)
def test_a_strike_before_its_sample_is_refused(start: float, length_s: float) -> None:
    bank, state = a_bank()
    with pytest.raises(ValueError, match=r"start|length"):
        advance(bank, state, 16, [Strike(0, start, length_s, np.ones(1))])
    assert state.free[0] == len(state.strikes)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("start", np.nan), ("length", 0.0), ("count", -1), ("upcoming", -1), ("within", 1 << 40), ("whole", 0),
        ("spacing", 0.0), ("phase", np.inf), ("cells", 0), ("cell_stop", -(1 << 40)), ("next", 1 << 40),
    ],
)  # fmt: skip
def test_a_strike_under_way_is_one_that_the_bank_has_made(name: str, value: float) -> None:
    bank, state = a_bank()
    advance(bank, state, 16, [Strike(0, 10.3, 0.1, np.ones(1), rigid_impulse_n_s=np.ones(3))])
    slot = int(state.ringing["strike"][0])
    state.strikes[name][slot] = value
    scratch = step_scratch(bank, 16)
    with pytest.raises(ValueError, match="strike"):
        advance_bank(state.at, 16, 48_000.0, np.zeros(16), tables(bank, state), scratch)


def test_more_nodes_at_a_sample_than_there_is_room_for_are_refused() -> None:
    bank, state = a_bank()
    advance(bank, state, 16, [Strike(0, 10.3, 0.1, np.ones(1))])
    slot = int(state.ringing["strike"][0])
    state.strikes["whole"][slot] = state.strikes["count"][slot] = 1000
    with pytest.raises(ValueError, match="nodes of a strike"):
        advance_bank(state.at, 16, 48_000.0, np.zeros(16), tables(bank, state), step_scratch(bank, 16))


@pytest.mark.parametrize("phase", [-1, 7])
def test_a_transmission_is_in_one_of_its_phases(phase: int) -> None:
    one = ModeSet(np.array([4e3]), np.array([30.0]), np.ones((1, 1)) + 0j)
    bank, state = append(*empty_bank(48_000, 1, transmissions=1), [one])
    scratch = step_scratch(bank, 16)._replace(transmitted=np.zeros((1, 1, 16)))
    state.transmissions["phase"] = 1
    advance_bank(0, 16, 48_000.0, np.zeros(16), tables(bank, state), scratch)
    state.transmissions["phase"] = phase
    with pytest.raises(ValueError, match="phase"):
        advance_bank(16, 16, 48_000.0, np.zeros(16), tables(bank, state), scratch)


def test_a_byte_that_is_no_truth_value_is_refused() -> None:
    bank, state = a_bank()
    observed = np.full(bank.observed.shape, 2, np.uint8).view(bool)
    odd = Bank(bank.sr, bank.body, bank.law, bank.weight, observed, bank.aims, bank.radiates)
    with pytest.raises(TypeError, match="observed"):
        advance_bank(0, 16, 48_000.0, np.zeros(16), tables(odd, state), step_scratch(bank, 16))


def test_the_order_of_earlier_traces_is_one_of_them() -> None:
    traces = Traces()
    traces.reserve(1)
    start, state = np.zeros(2, START), np.zeros(2, LINK_STATE)
    start["code"], start["index"] = (0, 1), (0, 1)
    state["quaternion_xyzw"] = 0, 0, 0, 1
    begin_step(state, state, 0.01, np.zeros(0, np.int64), True, start)
    touch = np.zeros(1, TOUCH)
    touch["code_a"], touch["code_b"], touch["normal"] = 0, 1, (0, 0, 1)
    given = touch, touch[:0], start, 0.01, 0.0, traces, np.zeros(1, CONTACT)
    assert make_contact_rows(*given) == 1
    assert traces.table.dtype == TRACE and len(traces.count) == MEMORY_STEPS + 1
    traces.table["order"][traces.newest, 0] = 7
    with pytest.raises(ValueError, match="order of a trace"):
        make_contact_rows(*given)
