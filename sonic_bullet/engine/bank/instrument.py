"""The bank as an instrument: tables and flat arrays from bodies' modes, and the state that goes with them.

A body has two parts: its modes (with the lines of its residual, which sound into the same signal) and its three
translations, which share one pole. b bodies, m lanes of all of them, W weight sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from sonic_bullet.engine.bank.layout import BANK_BODY, BANK_STRIKE, BLOCK, FLUSH, LANE_PAIR, RINGING, TRANSMISSION
from sonic_bullet.engine.bank.mode_set import ModeSet, Translation
from sonic_bullet.engine.bank.transmission import PHASE, SILENCED
from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.signal.elementary import complex_exp, expm1, sin


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """Constants of the instrument.

    body (b,) BANK_BODY; law (6, m): of each lane s/sr, d/ω and how its pole depends on its level; weight (W, 2·m), real
    parts first; observed (W, b): whether any weight of the body is not zero; aims (W,): which pair of rows of
    `BankState.aim` a set has in place of its weights, -1 for none; radiates (W,): sets of pressure, to which a force
    that lasts sends nothing (src/bank/bank.hpp).
    """

    sr: int
    body: Array
    law: Array
    weight: Array
    observed: Array
    aims: Array
    radiates: Array

    @property
    def body_count(self) -> int:
        """Number of bodies."""
        return len(self.body)

    @property
    def mode_count(self) -> int:
        """Number of modes of all bodies."""
        return int(self.body["columns"].sum())

    @property
    def columns(self) -> int:
        """Lanes of the body that has most, in whole groups: gains have as many."""
        return int((self.body["stop"] - self.body["start"]).max(initial=LANE_PAIR))


@dataclass(slots=True, eq=False)
class BankState:
    """State of the bank.

    Attributes
    ----------
    at : the next sample
    z, driven : (2·m,) free state at the next block's start, and what was driven since this block's
    sound : (W, b, 256) the block's free ringing
    pole, block : (2·m,) e^s and e^{256 s}, bent by level where a body is
    law, coming : (7, m) the bank's, with poles as they are now; (8, m) see `poles`
    transmissions, transmission_weight, transmission_sound : (b, J) TRANSMISSION, (J·W, 2·m), (J·W, b, 256)
    aim, turned, blend : (2·D, 2·m) weights of aimed sets as they are, and from the next block on; (D, b) 1 where these
        differ; (D, 256) scratch
    ringing : (b,) RINGING
    strikes, rows : (pool,) STRIKE and (pool, 10, columns) their phasors, and all that each adds
    free : (pool + 1,) how many rows are free, and which
    """

    at: int
    z: Array
    driven: Array
    sound: Array
    pole: Array
    block: Array
    law: Array
    coming: Array
    transmissions: Array
    transmission_weight: Array
    transmission_sound: Array
    aim: Array
    turned: Array
    blend: Array
    ringing: Array
    strikes: Array
    rows: Array
    free: Array

    def copy(self) -> BankState:
        """Return an independent copy: advancing one leaves the other."""
        names = (field.name for field in fields(self) if field.name != "at")
        arrays: dict[str, Any] = {name: getattr(self, name).copy() for name in names}
        return BankState(at=self.at, **arrays)

    def with_room(self, strikes: int) -> None:
        """Make room for so many strikes."""
        free = int(self.free[0])
        if free >= strikes:
            return
        pool = len(self.strikes)
        more = max(pool, strikes - free, 4)
        self.strikes = np.concatenate([self.strikes, np.zeros(more, BANK_STRIKE)])
        rows = np.empty((pool + more, *self.rows.shape[1:]))
        rows[:pool] = self.rows
        self.rows = rows
        kept = self.free[1 : free + 1]
        self.free = np.concatenate(
            [[free + more], np.arange(pool + more - 1, pool - 1, -1), kept, np.zeros(pool - free, np.int64)]
        ).astype(np.int64)


def audible(omega_rad_s: Array, decay_per_s: Array, sr: int) -> Array:
    """Return (m,) bool: modes the bank can play at the rate ``sr``; count the others with ``~``.

    Not audible: at or above sr/2, overdamped or all but critically so (ω ≤ d/1000), gone within a sample (d ≥ 2 sr), or
    not finite.
    """
    fastest_decay_per_sample = 2.0
    slowest_turn = 1e-3
    omega, decay = np.asarray(omega_rad_s, float), np.asarray(decay_per_s, float)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (omega < np.pi * sr)
            & (omega > slowest_turn * decay)
            & (omega > 0)
            & (decay >= 0)
            & (decay < fastest_decay_per_sample * sr)
        )


def flush_subnormals(values: Array) -> Array:
    """Set values below 1e-30 to zero: no product of theirs becomes subnormal."""
    return np.asarray(np.where(np.abs(values) < FLUSH, 0, values))


def empty_bank(
    sr: int,
    weight_sets: int = 1,
    at: int = 0,
    transmissions: int = 0,
    aims: Array | None = None,
    radiates: Array | None = None,
) -> tuple[Bank, BankState]:
    """Build a bank without bodies and its state at absolute sample ``at``.

    transmissions: partners to which each body may transmit. aims, radiates: as of `Bank`, None: none. Raises
    AudioError on a rate outside 1 … 10 MHz.
    """
    if not (isinstance(sr, int | np.integer) and 0 < sr <= 10_000_000):
        raise AudioError(f"sample rate {sr}", "give a whole number of Hz, 44100 or 48000 say")
    none = np.zeros((weight_sets, 0))
    aims = np.full(weight_sets, -1, np.int64) if aims is None else aims
    radiates = np.zeros(weight_sets, bool) if radiates is None else radiates
    aimed = int(np.count_nonzero(aims >= 0))
    bank = Bank(int(sr), np.zeros(0, BANK_BODY), np.zeros((6, 0)), none, none.astype(bool), aims, radiates)
    z, driven, pole, block = np.zeros((4, 0))
    silent, strikes = np.zeros((weight_sets, 0, BLOCK)), np.zeros(0, BANK_STRIKE)
    rows, free = np.zeros((0, 10, LANE_PAIR)), np.zeros(1, np.int64)
    state = BankState(
        int(at), z, driven, silent, pole, block, np.zeros((7, 0)), np.zeros((8, 0)),
        np.zeros((0, transmissions), TRANSMISSION), np.zeros((transmissions * weight_sets, 0)),
        np.zeros((transmissions * weight_sets, 0, BLOCK)),
        np.zeros((2 * aimed, 0)), np.zeros((aimed, 0), np.int64), np.zeros((aimed, BLOCK)), np.zeros(0, RINGING),
        strikes, rows, free,
    )  # fmt: skip
    return bank, state


def append(bank: Bank, state: BankState, bodies: Sequence[ModeSet]) -> tuple[Bank, BankState]:
    """Return bank and state with further bodies, silent at first; the others continue unchanged, bit by bit.

    The old pair stays usable. Raises AudioError where a mode is not `audible`, or shapes or numbers are wrong.
    """
    sets = bank.weight.shape[0]
    for one in bodies:
        _check(one, sets, bank.sr)
    sizes = np.array([len(one.omega_rad_s) for one in bodies], np.int64)
    stops = np.cumsum(-(-sizes // LANE_PAIR) * LANE_PAIR)
    total = int(stops[-1]) if len(bodies) else 0
    body = np.zeros(len(bodies), BANK_BODY)
    base = bank.law.shape[1]
    law, weight = np.zeros((6, total)), np.zeros((sets, total), complex)
    law[5] = 1.0
    pole, block = np.zeros(total, complex), np.zeros(total, complex)
    observed = np.zeros((sets, len(bodies)), bool)
    for i, (one, stop, size) in enumerate(zip(bodies, stops, sizes, strict=True)):
        start = int(stop) + (-int(size) // LANE_PAIR) * LANE_PAIR
        lanes = slice(start, start + int(size))
        body[i]["start"], body[i]["stop"], body[i]["columns"] = base + start, base + stop, size
        body[i]["bent"] = one.bend is not None or one.damping_growth is not None
        step = (-one.decay_per_s + 1j * one.omega_rad_s) / bank.sr
        law[0, lanes], law[1, lanes], law[2, lanes] = step.real, step.imag, one.decay_per_s / one.omega_rad_s
        law[3, lanes], law[4, lanes] = _or_zero(one.bend, int(size)), _or_zero(one.damping_growth, int(size))
        law[5, lanes] = one.damping_growth_power
        pole[lanes], block[lanes] = complex_exp(step), complex_exp(BLOCK * step)
        weight[:, lanes] = flush_subnormals(one.weight)
        observed[:, i] = one.weight.any(axis=1)
        if one.translation is not None:
            _enter_translation(body[i], one.translation, bank.sr)
    grown = Bank(
        bank.sr,
        np.concatenate([bank.body, body]),
        np.concatenate([bank.law, law], axis=1),
        np.stack([_append_complex(bank.weight[w], weight[w]) for w in range(sets)]).reshape(sets, -1),
        np.concatenate([bank.observed, observed], axis=1),
        bank.aims,
        bank.radiates,
    )
    aimed = np.repeat(weight[np.flatnonzero(bank.aims >= 0)], 2, axis=0)
    state = state.copy()
    silent, ringing = np.zeros(total, complex), np.zeros(len(bodies), RINGING)
    ringing["strike"] = -1
    rows = state.rows
    if rows.shape[2] < grown.columns:
        rows = np.zeros((*rows.shape[:2], grown.columns))
        rows[:, :, : state.rows.shape[2]] = state.rows
    return grown, replace(
        state,
        z=_append_complex(state.z, silent),
        driven=_append_complex(state.driven, silent),
        sound=np.concatenate([state.sound, np.zeros((sets, len(bodies), BLOCK))], axis=1),
        pole=_append_complex(state.pole, pole),
        block=_append_complex(state.block, block),
        law=np.concatenate([state.law, np.vstack([law, np.zeros(total)])], axis=1),
        coming=np.concatenate([state.coming, np.zeros((8, total))], axis=1),
        transmissions=np.concatenate(
            [state.transmissions, np.zeros((len(bodies), state.transmissions.shape[1]), TRANSMISSION)]
        ),
        transmission_weight=np.stack([_append_complex(one, silent) for one in state.transmission_weight]).reshape(
            len(state.transmission_weight), -1
        )
        if len(state.transmission_weight)
        else np.zeros((0, 2 * grown.law.shape[1])),
        transmission_sound=np.concatenate(
            [state.transmission_sound, np.zeros((len(state.transmission_sound), len(bodies), BLOCK))], axis=1
        ),
        aim=np.array([_append_complex(one, more) for one, more in zip(state.aim, aimed, strict=True)]).reshape(
            len(aimed), 2 * grown.law.shape[1]
        ),
        turned=np.concatenate([state.turned, np.zeros((len(state.turned), len(bodies)), np.int64)], axis=1),
        ringing=np.concatenate([state.ringing, ringing]),
        rows=rows,
    )


def subset(bank: Bank, state: BankState, keep: Array) -> tuple[Bank, BankState]:
    """Return bank and state with only the bodies ``keep`` (k,), ascending, which continue unchanged, bit by bit.

    The others must be `silent`. The strikes are the old state's own: it must not be used afterwards.
    """
    body = bank.body[keep]
    size = body["stop"] - body["start"]
    stop = np.cumsum(size)
    lane = np.repeat(body["start"] - stop + size, size) + np.arange(int(size.sum()))
    body["start"], body["stop"] = stop - size, stop
    both = np.concatenate([lane, bank.law.shape[1] + lane])
    law, weight = np.take(bank.law, lane, axis=1), np.take(bank.weight, both, axis=1)
    few = Bank(bank.sr, body, law, weight, np.take(bank.observed, keep, axis=1), bank.aims, bank.radiates)
    flat = {name: getattr(state, name)[both] for name in ("z", "driven", "pole", "block")}
    flat |= {name: np.take(getattr(state, name), lane, axis=1) for name in ("law", "coming")}
    flat |= {name: np.take(getattr(state, name), keep, axis=1) for name in ("sound", "transmission_sound", "turned")}
    flat["aim"] = np.take(state.aim, both, axis=1)
    number = np.full(bank.body_count, -1)
    number[keep] = np.arange(len(keep))
    transmissions = state.transmissions[keep]
    transmissions["to"] = number[transmissions["to"]]
    transmissions["phase"][transmissions["to"] < 0] = PHASE.off
    weights = np.take(state.transmission_weight, both, axis=1)
    return few, replace(
        state, **flat, transmissions=transmissions, transmission_weight=weights, ringing=state.ringing[keep]
    )


def silent(state: BankState) -> Array:
    """Return (b,) whether nothing of a body rings, and no strike on it is under way."""
    now = state.ringing
    rings = (now["ringing"] != 0) | (now["driven"] != 0) | (now["tiled"] != 0) | (now["moving"] != 0)
    return np.asarray(~rings & (now["strike"] < 0))


def silence(state: BankState) -> BankState:
    """Return the state at the same sample with nothing ringing and no strike under way."""
    state = state.copy()
    for name in ("z", "driven", "sound", "transmission_sound"):
        getattr(state, name)[...] = 0
    for name in ("ringing", "driven", "tiled", "moving", "motion"):  # poles and transmissions stay: contacts do
        state.ringing[name] = 0
    state.ringing["strike"] = -1
    state.transmissions["phase"] = SILENCED[state.transmissions["phase"]]
    state.ringing["transmissions"] = np.count_nonzero(state.transmissions["phase"] != PHASE.off, axis=1)
    pool = len(state.strikes)
    state.free[...] = np.concatenate([[pool], np.arange(pool - 1, -1, -1)])
    return state


def _check(one: ModeSet, sets: int, sr: int) -> None:
    m = len(one.omega_rad_s)
    if one.decay_per_s.shape != (m,) or one.weight.shape != (sets, m) or not np.isfinite(one.weight).all():
        raise AudioError(
            f"modes of shape {one.omega_rad_s.shape}, {one.decay_per_s.shape}, weights {one.weight.shape} for {sets} "
            "weight sets",
            "give finite (m,), (m,), (W, m)",
        )
    omega, decay = one.omega_rad_s, one.decay_per_s
    if one.translation is not None:
        omega = np.append(omega, one.translation.omega_rad_s)
        decay = np.append(decay, one.translation.decay_per_s)
        if not np.isfinite(one.translation.weight):
            raise AudioError("a translation whose weight is not finite", "give a finite number of Pa·m per N·s")
    if not audible(omega, decay, sr).all():
        raise AudioError(
            "a mode beyond half the sample rate, overdamped or not finite", "keep the modes that `audible` names"
        )


def _enter_translation(row: Any, one: Translation, sr: int) -> None:
    """Enter a translation into a BANK_BODY row."""
    s = complex(-one.decay_per_s, one.omega_rad_s) / sr
    quadrature = one.decay_per_s / one.omega_rad_s
    grown, half = float(expm1(s.real)), float(sin(s.imag / 2))
    pole = complex(complex_exp(s))
    less_one = complex(grown - 2 * half * half * (1 + grown), pole.imag)  # e^s - 1
    onset = (1 + 1j * quadrature) * less_one / s
    row["rigid"], row["rigid_quadrature"] = 1, quadrature
    row["rigid_weight"] = one.weight if abs(one.weight) >= FLUSH else 0.0
    for name, value in (("rigid_log_pole", s), ("rigid_pole", pole), ("rigid_onset", onset)):
        row[name] = value.real, value.imag


def _or_zero(values: Array | None, m: int) -> Array:
    if values is None:
        return np.zeros(m)
    if np.shape(values) != (m,) or not np.isfinite(values).all():
        raise AudioError(
            f"bend or damping growth of shape {np.shape(values)} for {m} modes", "give a finite number for each mode"
        )
    return np.asarray(values, float)


def _append_complex(flat: Array, more: Array) -> Array:
    """Append the complex values ``more`` to a flat array, real parts first."""
    half = len(flat) // 2
    return np.concatenate([flat[:half], more.real, flat[half:], more.imag])
