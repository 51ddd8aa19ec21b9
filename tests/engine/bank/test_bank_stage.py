"""The bank as a stage of the run time: a step's pulses entered as a table, buffers that stay, rows that fall silent."""

from __future__ import annotations

import numpy as np
import pytest

from sonic_bullet._engine import advance_bank, enter_pulses
from sonic_bullet.engine.bank import Bank, BankState, ModeSet, Translation, append, empty_bank
from sonic_bullet.engine.runtime.tables import PULSE
from sonic_bullet.records import Array
from tests.made.banks import Strike, advance, step_scratch, tables

SR = 48_000


def bodies(rng: np.random.Generator) -> tuple[Bank, BankState]:
    sets = [
        ModeSet(
            2 * np.pi * rng.uniform(100, 15_000, m),
            rng.uniform(30.0, 300.0, m),
            rng.normal(size=(1, m)) + 0j,
            translation=Translation(7000.0, 7000.0, 1.0),
        )
        for m in (40, 9)
    ]
    return append(*empty_bank(SR), sets)


def pulses(rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    table = np.zeros(count, PULSE)
    table["body"] = [0, 1]
    table["start_s"], table["length_s"] = rng.uniform(0, 1e-3, count), 10 ** rng.uniform(-4.5, -3, count)
    table["flat"], table["transmitted_fraction"] = rng.integers(2, size=count), rng.uniform(size=count)
    table["impulse_n_s"], table["ahead"] = rng.normal(size=(count, 3)), rng.integers(2, size=count)
    return table, rng.normal(size=(count, 2, 48))


def enter(bank: Bank, state: BankState, table: Array, modal_impulse: Array) -> int:
    scratch = step_scratch(bank, 0)._replace(count=np.array([len(table), 0]), pulse=table, modal_impulse=modal_impulse)
    return int(enter_pulses(0.0, 1 / 240, 0, float(SR), tables(bank, state), scratch))


def test_a_table_of_pulses_strikes_both_bodies_as_strikes_do_one_by_one() -> None:
    rng = np.random.default_rng(2)
    bank, state = bodies(rng)
    table, modal_impulse = pulses(rng, 20)
    strikes = []
    for pulse, gain in zip(table, modal_impulse, strict=True):
        start = (pulse["start_s"] + (1 / 240 if pulse["ahead"] else 0.0)) * SR
        for side, m in enumerate((40, 9)):
            rigid_impulse = (1.0, -1.0)[side] * pulse["transmitted_fraction"] * pulse["impulse_n_s"]
            strikes.append(
                Strike(
                    side,
                    start,
                    pulse["length_s"],
                    pulse["transmitted_fraction"] * gain[side, :m],
                    bool(pulse["flat"]),
                    rigid_impulse,
                )
            )
    single, table_dipole, single_dipole = state.copy(), np.zeros((2, 3, 900)), np.zeros((2, 3, 900))
    state.with_room(40)
    assert enter(bank, state, table, modal_impulse) == 20
    assert np.array_equal(
        advance(bank, state, 900, dipole=table_dipole), advance(bank, single, 900, strikes, dipole=single_dipole)
    )
    assert np.array_equal(table_dipole, single_dipole)
    assert table_dipole.any()


def test_a_full_pool_is_said_and_takes_whole_pulses_alone() -> None:
    rng = np.random.default_rng(3)
    bank, state = bodies(rng)
    table, modal_impulse = pulses(rng, 5)
    state.with_room(5)
    free = int(state.free[0])
    assert enter(bank, state, table, modal_impulse) == free // 2
    assert state.free[0] == free % 2


@pytest.mark.parametrize("dirty", [0, 1])
def test_rows_of_silent_bodies_are_zero_and_are_told_from_those_that_sound(dirty: int) -> None:
    """Buffers stay from call to call: a body that falls silent leaves zeros, one that was silent is not touched."""
    rng = np.random.default_rng(4)
    bank, state = bodies(rng)
    state.with_room(2)
    table, modal_impulse = pulses(rng, 1)
    table["body"], table["start_s"] = [0, 0], 0.0
    enter(bank, state, table, modal_impulse)
    source, dipole = np.full((1, 2, 300), float(dirty)), np.full((2, 3, 300), float(dirty))
    sounds, group = np.full((2, 2), dirty), tables(bank, state)
    scratch = step_scratch(bank, 300)._replace(source=source, dipole=dipole, sounds=sounds)
    loud = []
    for step in range(600):
        advance_bank(step * 300, 300, float(SR), np.zeros(300), group, scratch)
        loud.append(sounds[0].copy())
        assert not source[0, 1].any()
        assert not dipole[1].any()
        assert not sounds[1].any()
    assert loud[0].all()
    assert not loud[-1].any()
    assert not source.any()
    assert not dipole.any()
