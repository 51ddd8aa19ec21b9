"""The bank's door for whoever is not the run time: strikes and forces as records, checked, and samples back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.synth.bank import bank_kernel
from sonic_bullet.synth.bank.instrument import Bank, BankState, flushed
from sonic_bullet.synth.bank.strike_pool import enter_strike
from sonic_bullet.synth.pulse import pulse_table

NOWHERE = np.zeros(3)


@dataclass(frozen=True, slots=True, eq=False)
class Strike:
    """A finite force pulse on one body (synth.pulse).

    start: absolute time of its begin in samples (any fraction). length_s, flat (half-sine, else Hertz'): its shape.
    gain (m,): φᵀĵ of the body's modes in N·s/√kg. shove_n_s (3,): the impulse, for its translations.
    """

    body: int
    start: float
    length_s: float
    gain: Array
    flat: bool = False
    shove_n_s: Array = field(default_factory=lambda: NOWHERE)


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
    pushed: Array | None = None,
) -> Array:
    """The next n samples: y (W, b, n) of the modes, and into ``pushed`` (b, 3, n) of the translations. Changes
    ``state`` in place.

    strikes: those that become known now; each starts after the previous call's last sample, in any call before or at
    which it sounds. forces: for exactly these n samples; progress (n,): where between gain0 and gain1 each sample lies.
    Strikes and forces of a body are added in order of start and of the list. Samples below 1e-30 are 0. Raises
    AudioError on wrong shapes, NaN, or a strike in the past.
    """
    if n < 0 or len(state.ringing) != bank.body_count or len(state.z) != 2 * bank.law.shape[1]:
        raise AudioError(
            f"{n} samples for a state of {len(state.ringing)} bodies and a bank of {bank.body_count}",
            "advance the state that `append` returned",
        )
    along = np.zeros(n) if progress is None else np.ascontiguousarray(progress, float)
    if along.shape != (n,) or not np.isfinite(along).all():
        raise AudioError(f"progress of shape {along.shape} for {n} samples", "give a finite number for each sample")
    drives, body, signal, gain, direction = _drives(bank, n, forces)
    _enter(bank, state, strikes)
    out = np.zeros((bank.weight.shape[0], bank.body_count, n))
    if pushed is None:
        pushed = np.zeros((bank.body_count, 3, n if bank.body["rigid"].any() else 0))  # else nobody writes there
    else:
        pushed[...] = 0.0
    scratch = state.scratch
    scratch.fit(bank.body_count, drives, n)
    bank_kernel.advance(
        state.at, n, float(bank.sr), bank.body, bank.law, bank.weight, bank.observed,
        state.ringing, state.z, state.driven, state.sound, state.pole, state.block, state.strikes, state.rows,
        state.free, pulse_table(), drives, body, signal, gain[0], gain[1], direction[0], direction[1], along,
        scratch.first, scratch.side, scratch.signal, scratch.kick, scratch.plan, scratch.flat, out, pushed,
        np.zeros((bank.body_count, 2), np.int64),
    )  # fmt: skip
    state.at += n
    return out


def _enter(bank: Bank, state: BankState, strikes: Sequence[Strike]) -> None:
    """Enter strikes into the pool."""
    state.with_room(len(strikes))
    gains = [_padded(bank, strike.body, strike.gain, "strike") for strike in strikes]
    for strike in strikes:
        length = strike.length_s * bank.sr
        if not (np.isfinite(strike.start) and 0 < length < np.inf and np.isfinite(strike.shove_n_s).all()):
            raise AudioError(
                f"a strike on body {strike.body} of {strike.length_s} s at {strike.start}",
                "give a finite start, shove and length above 0",
            )
        if np.ceil(strike.start) < state.at:
            raise AudioError(
                f"a strike at sample {strike.start:.2f}, but {state.at} samples have sounded",
                "pass strikes before their time has sounded",
            )
    for strike, gain in zip(strikes, gains, strict=True):
        x, y, z = (float(value) for value in strike.shove_n_s)
        enter_strike(
            strike.body, float(strike.start), float(strike.length_s), int(strike.flat), 1.0, gain, x, y, z, state.at,
            float(bank.sr), bank.body, bank.law, state.ringing, state.strikes, state.rows, state.free, pulse_table(),
        )  # fmt: skip


def _drives(bank: Bank, n: int, forces: Sequence[Force]) -> tuple[int, Array, Array, Array, Array]:
    """Forces as the kernel takes them: how many, bodies (p, 2), signals (p, n), gains (2, p, 2, columns), directions
    (2, p, 3).
    """
    count = len(forces)
    body = np.full((count, 2), -1, np.int64)
    gain, direction = np.zeros((2, count, 2, bank.columns)), np.zeros((2, count, 3))
    for i, force in enumerate(forces):
        if np.shape(force.force_n) != (n,):
            raise AudioError(f"a force on body {force.body} of shape {np.shape(force.force_n)}", f"give {n} samples")
        body[i, 0] = force.body
        for end, (values, along) in enumerate(((force.gain0, force.direction0), (force.gain1, force.direction1))):
            gain[end, i, 0] = _padded(bank, force.body, values, "force")
            direction[end, i] = along
    signal = np.array([force.force_n for force in forces], float).reshape(count, n)
    if not (np.isfinite(signal).all() and np.isfinite(direction).all()):
        raise AudioError("a force that is not finite", "look at the surface model's input: loads, speeds, profile")
    return count, body, signal, gain, direction


def _padded(bank: Bank, body: int, gain: Array, what: str) -> Array:
    """(columns,) a gain (m,) with zeros behind. Raises AudioError on an unknown body, a wrong shape, or NaN."""
    if not 0 <= body < bank.body_count:
        raise AudioError(f"a {what} on body {body} of {bank.body_count}", "append the body first")
    size = int(bank.body[body]["columns"])
    if np.shape(gain) != (size,):
        raise AudioError(f"a {what} on body {body}: gain of shape {np.shape(gain)}", f"give {size} numbers")
    if not np.isfinite(gain).all():
        raise AudioError(f"a {what} whose gain is not finite", "look at the mode shapes and the contact's direction")
    out = np.zeros(bank.columns)
    out[:size] = flushed(gain)
    return out
