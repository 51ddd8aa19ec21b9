"""The bank by itself: strikes and forces as records, and samples back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sonic_bullet import _engine
from sonic_bullet._engine import advance_bank, enter_strike
from sonic_bullet.engine.bank import Bank, BankState
from sonic_bullet.engine.bank.instrument import flush_subnormals
from sonic_bullet.engine.runtime.tables import PULSE
from sonic_bullet.records import Array

NOWHERE = np.zeros(3)


def set_poles(bank: Bank, state: BankState, b: int, step: Array) -> None:
    """Set other poles (m,), s = (-d + iω)/sr, of body b's modes from the next block's start."""
    _engine.set_poles(b, step, np.zeros(0), bank.law, (state, bank))


def set_transmissions(bank: Bank, state: BankState, b: int, wanted: Mapping[int, Array]) -> None:
    """Set what body b transmits from the next block's start: weights (W, m) by partner."""
    weight = np.array(list(wanted.values()), complex).reshape(
        len(wanted), len(bank.observed), int(bank.body[b]["columns"])
    )
    _engine.set_transmissions(b, np.array(list(wanted), np.int64), weight, (state, bank))


class ScratchTables(NamedTuple):
    """Tables of one step: pulses and drives in, sound out; see src/groups.hpp."""

    count: Array  # type: ignore[assignment]
    pulse: Array
    modal_impulse: Array
    force: Array
    gain0: Array
    gain1: Array
    direction0: Array
    direction1: Array
    body: Array
    slot: Array
    source: Array
    transmitted: Array
    dipole: Array
    sounds: Array


@dataclass(frozen=True, slots=True, eq=False)
class Strike:
    """A finite force pulse on one body (contact.pulse_shape).

    start: absolute time of its begin in samples (any fraction). length_s, flat (half-sine, else Hertz'): its shape.
    gain (m,): φᵀĵ of the body's modes in N·s/√kg. rigid_impulse_n_s (3,): the impulse, for its translations.
    """

    body: int
    start: float
    length_s: float
    gain: Array
    flat: bool = False
    rigid_impulse_n_s: Array = field(default_factory=lambda: NOWHERE)


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """A force signal on one body over one call: force_n (n,) in newton, each sample acting as the impulse force·period.

    gain0, gain1 (m,): participation in 1/√kg where progress is 0 and 1, linear in between; direction0, direction1 (3,):
    the force on the translations per newton of force_n.
    """

    body: int
    force_n: Array
    gain0: Array
    gain1: Array
    direction0: Array = field(default_factory=lambda: NOWHERE)
    direction1: Array = field(default_factory=lambda: NOWHERE)


def advance(
    bank: Bank,
    state: BankState,
    n: int,
    strikes: Sequence[Strike] = (),
    forces: Sequence[Force] = (),
    progress: Array | None = None,
    dipole: Array | None = None,
) -> Array:
    """The next n samples: y (W, b, n) of the modes, and into ``dipole`` (b, 3, n) of the translations. Changes
    ``state`` in place.

    strikes: those that become known now; each starts half a sample after the previous call's last one at least, in any
    call before or at which it sounds. forces: for exactly these n samples; progress (n,): where between gain0 and gain1
    each sample lies.
    Strikes and forces of a body are added in order of start and of the list.
    """
    along = np.zeros(n) if progress is None else np.ascontiguousarray(progress, float)
    _enter(bank, state, strikes)
    out = np.zeros((bank.weight.shape[0], bank.body_count, n))
    if dipole is None:
        dipole = np.zeros((bank.body_count, 3, n))
    dipole[...] = 0.0
    scratch = step_scratch(bank, n, forces)._replace(source=out, transmitted=transmitted(bank, state, n), dipole=dipole)
    advance_bank(state.at, n, float(bank.sr), along, tables(bank, state), scratch)
    state.at += n
    return out


def tables(bank: Bank, state: BankState) -> tuple[BankState, Bank]:
    """The bank's group."""
    return state, bank


def transmitted(bank: Bank, state: BankState, n: int) -> Array:
    """Room for what touching bodies transmit."""
    return np.zeros((*bank.observed.shape, n if state.transmissions.shape[1] else 0))


def _enter(bank: Bank, state: BankState, strikes: Sequence[Strike]) -> None:
    """Enter strikes into the pool."""
    state.with_room(len(strikes))
    for strike in strikes:
        gain, length = _padded(bank, strike.gain), float(strike.length_s) * float(bank.sr)
        impulse_n_s = np.ascontiguousarray(strike.rigid_impulse_n_s, float)
        group = tables(bank, state)
        enter_strike(
            strike.body, float(strike.start), length, bool(strike.flat), 1.0, gain, impulse_n_s, state.at, group
        )


def step_scratch(bank: Bank, n: int, forces: Sequence[Force] = ()) -> ScratchTables:
    """Tables of a step with these forces as drives, without pulses."""
    count, b = len(forces), bank.body_count
    body = np.full((count, 2), -1, np.int64)
    gain, direction = np.zeros((2, count, 2, bank.columns)), np.zeros((2, count, 3))
    for i, force in enumerate(forces):
        body[i, 0] = force.body
        for end, (values, along) in enumerate(((force.gain0, force.direction0), (force.gain1, force.direction1))):
            gain[end, i, 0] = _padded(bank, values)
            direction[end, i] = along
    signal = np.array([force.force_n for force in forces], float).reshape(-1)
    sets = bank.weight.shape[0]
    return ScratchTables(
        np.array([0, count]), np.zeros(0, PULSE), np.zeros((0, 2, bank.columns)), signal, gain[0], gain[1],
        direction[0], direction[1], body, np.zeros(count, np.int64), np.zeros((sets, b, n)), np.zeros((sets, b, 0)),
        np.zeros((b, 3, n)), np.zeros((b, 2), np.int64),
    )  # fmt: skip


def _padded(bank: Bank, gain: Array) -> Array:
    """(columns,) a gain (m,) with zeros behind."""
    out = np.zeros(bank.columns)
    out[: len(gain)] = flush_subnormals(gain)
    return out
