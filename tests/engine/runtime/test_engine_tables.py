"""The run time's tables at the engine's door: bound as they are, and refused where they are of another kind."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from sonic_bullet import _engine
from sonic_bullet.engine.runtime.synthesis_state import Setup, State, start
from sonic_bullet.records import Air, Microphone


def state_of() -> State:
    return start(Setup(48_000, (Microphone(np.zeros(3)),), 0, Air()))


def advance(state: State, contacts: np.ndarray, rows: tuple[int, int]) -> tuple[int, int]:
    """Take in one step of no bodies with these contacts."""
    step = np.zeros(1, _engine.STEP)
    step["dt_s"], step["row"] = 1 / 240, rows
    none, aim = np.zeros((1, 0, 3)), np.zeros((0, 0, 1, 3))
    out, reads = np.zeros((1, 0)), np.zeros(1, np.int64)
    poses = none, np.zeros((1, 0, 4)), np.zeros((1, 0), bool)
    done, status = state.engine().advance_steps(
        0, 0, False, _engine.STEP_NEW, 48_000.0, step, contacts, *poses, aim, 0, False, reads, state.sets, out, out
    )
    return done, status


def test_a_fresh_state_takes_in_a_step() -> None:
    assert advance(state_of(), np.zeros(0, _engine.CONTACT), (0, 0)) == (1, _engine.STEPS_DONE)


def test_a_contact_of_a_body_that_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="contact body: 0 is not in"):
        advance(state_of(), np.zeros(1, _engine.CONTACT), (0, 1))


def test_rows_beyond_the_contacts_are_refused() -> None:
    with pytest.raises(ValueError, match="row: 2 is not in 0 … 1"):
        advance(state_of(), np.zeros(1, _engine.CONTACT), (0, 2))


@pytest.mark.parametrize("broken", [np.zeros((4, 0, 3), np.float32), np.zeros((4, 0)), np.zeros((4, 2, 6))[:, :, ::2]])
def test_a_table_of_another_kind_shape_or_order_is_refused(broken: np.ndarray) -> None:
    state = state_of()
    state.window = replace(state.window, position_m=broken)
    with pytest.raises(TypeError, match="position_m"):
        state.engine()


def test_a_table_of_other_bodies_is_refused() -> None:
    state = state_of()
    state.window = replace(state.window, teleported=np.zeros((4, 1), bool))
    with pytest.raises(ValueError, match=r"window\.teleported: 1 along axis 1, not 0"):
        state.engine()


def test_tables_stay_in_c_order_as_bodies_come_and_go() -> None:
    window = state_of().window
    for count in (1, 3, 4):
        window.with_bodies(np.ones((count, 3)), np.ones((count, 4)))
        assert all(getattr(window, one.name).flags.c_contiguous for one in fields(window))
    window.subset(np.array([0, 2, 5]), np.arange(8))
    assert all(getattr(window, one.name).flags.c_contiguous for one in fields(window))
