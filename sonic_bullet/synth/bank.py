"""A bank of damped sinusoids with explicit state: forces on modes in, velocities weighted for sensors out.

    mass-normalised mode  q̈ + 2d q̇ + (ω² + d²) q = f(t) = φᵀF(t)
        [physics of any vibration text, e.g. Meirovitch 2001, eq. 7.113]
    pole s = -d + iω, state z, velocity q̇ = Re z;   an impulse j at u:   z += (1 + i d/ω) φᵀĵ j e^{s(t-u)}
    output of weight set w and body b:   y[w, b, n] = Σ_modes Re(weight[w] z[n])

(that is q̇ = e^{-dt}(cos ωt - (d/ω) sin ωt): the continuous-time response, sampled; strikes are exact at any sub-sample
time, and nothing aliases.)

Modes of all bodies lie in one flat array, a body's in whole groups of 8 (spare lanes are zero). A body below the floor
costs nothing. Time is counted in absolute samples; blocks of 256 lie on that grid, so any way of cutting the calls
gives the same bits (`bank_kernel`). `advance` works in place: `copy()` a state first to look ahead and come back. b
bodies, m modes of one body, W weight sets, n samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.records.errors import AudioError
from sonic_bullet.synth import bank_kernel
from sonic_bullet.synth.pending import Pending, Strike, flushed, padded_gains, with_strikes, without
from sonic_bullet.synth.tile import BLOCK
from sonic_bullet.synth.vector import LANES

__all__ = ["Bank", "BankState", "Force", "ModeSet", "Strike", "advance", "append", "audible", "empty_bank", "silence"]

FLOOR = 1e-15
"""Modes with |z| below this (in √J·√2) are set to zero: ½|z|² = 5e-31 J is 1e-10 of the mode's thermal energy kT at 300
K.
"""

FASTEST_DECAY_PER_SAMPLE = 2.0
SLOWEST_TURN = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class ModeSet:
    """One body's modes for the bank: omega_rad_s (m,) of the damped modes, decay_per_s (m,), weight (W, m) complex.

    All `audible`.

    held: forces act evenly over the sample before each instant, (e^s - 1)/s, and strikes' impulses over their spacing,
    not at once: for modes that are gone within a few samples, of which a slow force must leave its slope alone. bend,
    damping_growth (m,): of level-dependent modes, ω (1 + bend·|z|²) and d (1 +
    (damping_growth·|z|)^damping_growth_power); None: linear. See `bank_kernel.bend_poles`.
    """

    omega_rad_s: Array
    decay_per_s: Array
    weight: Array
    held: bool = False
    bend: Array | None = None
    damping_growth: Array | None = None
    damping_growth_power: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Force:
    """A force signal on one body over one call: force_n (n,) in newton, each sample acting as the impulse force·period.

    gain0, gain1 (m,): participation in 1/√kg where progress is 0 and 1, linear in between.
    """

    body: int
    force_n: Array
    gain0: Array
    gain1: Array


@dataclass(frozen=True, slots=True, eq=False)
class Bank:
    """The instrument. offset (b+1,): segments of the flat arrays (whole groups of 8 lanes); count (b,): modes in each.

    log_pole (2·modes,): s/sr, real parts first; pole = e^{s/sr}; block = e^{256 s/sr}; quadrature (modes,) = d/ω;
    weight (W, 2·modes); observed (W, b): whether any weight of the body is not zero. held (modes,): of `ModeSet`; there
    1 + i·quadrature is what (1 + i d/ω)(e^s - 1)/s is to its real part, which is in the weight. bend, damping_growth,
    power (modes,), bent (b,): of bodies whose poles go with their level.
    """

    sr: int
    offset: Array
    count: Array
    log_pole: Array
    pole: Array
    block: Array
    quadrature: Array
    weight: Array
    observed: Array
    held: Array
    bend: Array
    damping_growth: Array
    power: Array
    bent: Array

    @property
    def body_count(self) -> int:
        return len(self.count)

    @property
    def mode_count(self) -> int:
        return int(self.count.sum())


@dataclass(slots=True, eq=False)
class BankState:
    """What the bank remembers. at: the next sample. z, driven (2·modes,): free state at the next block's start, and
    what was driven since this block's. sound (W, b, 256): the block's free ringing. ringing, is_driven, tiled (b,):
    what of it is in use. pending: strikes under way. pole, block (2·modes,): the bank's own, bent by level where a body
    is.
    """

    at: int
    z: Array
    driven: Array
    sound: Array
    ringing: Array
    is_driven: Array
    tiled: Array
    pending: Pending
    pole: Array
    block: Array

    def copy(self) -> BankState:
        """A state of its own: advancing one leaves the other."""
        arrays: dict[str, Any] = {
            name: getattr(self, name).copy()
            for name in ("z", "driven", "sound", "ringing", "is_driven", "tiled", "pole", "block")
        }
        return BankState(at=self.at, pending=self.pending.copy(), **arrays)


def audible(omega_rad_s: Array, decay_per_s: Array, sr: int) -> Array:
    """(m,) bool: modes the bank can play at the rate ``sr``; count the others with ``~``.

    Dropped: at or above sr/2, overdamped or all but critically so (ω ≤ d/1000), or gone within a sample (d ≥ 2 sr), or
    not finite.
    """
    omega, decay = np.asarray(omega_rad_s, float), np.asarray(decay_per_s, float)
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (omega < np.pi * sr)
            & (omega > SLOWEST_TURN * decay)
            & (omega > 0)
            & (decay >= 0)
            & (decay < FASTEST_DECAY_PER_SAMPLE * sr)
        )


def empty_bank(sr: int, weight_sets: int = 1, at: int = 0) -> tuple[Bank, BankState]:
    """A bank without bodies and its state at absolute sample ``at``. Raises AudioError on a rate outside 1 … 10 MHz."""
    if not (isinstance(sr, int | np.integer) and 0 < sr <= 10_000_000):
        raise AudioError(f"sample rate {sr}", "give a whole number of Hz, 44100 or 48000 say")
    none, flags = np.zeros(0), np.zeros(0, bool)
    bank = Bank(
        int(sr), np.zeros(1, np.int64), np.zeros(0, np.int64), none, none, none, none,
        np.zeros((weight_sets, 0)), np.zeros((weight_sets, 0), bool), flags, none, none, none, flags,
    )  # fmt: skip
    silent = (np.zeros((weight_sets, 0, BLOCK)), flags.copy(), flags.copy(), flags.copy(), Pending.none())
    return bank, BankState(int(at), none.copy(), none.copy(), *silent, none.copy(), none.copy())


def append(bank: Bank, state: BankState, bodies: Sequence[ModeSet]) -> tuple[Bank, BankState]:
    """Bank and state with further bodies, silent at first; those already there go on unchanged, bit by bit.

    The old pair stays usable.

    Raises AudioError where a mode is not `audible`, or shapes or numbers are wrong.
    """
    sets = bank.weight.shape[0]
    sizes = []
    for body in bodies:
        m = len(body.omega_rad_s)
        if body.decay_per_s.shape != (m,) or body.weight.shape != (sets, m) or not np.isfinite(body.weight).all():
            raise AudioError(
                f"modes of shape {body.omega_rad_s.shape}, {body.decay_per_s.shape}, weights "
                f"{body.weight.shape} for {sets} weight sets",
                "give finite (m,), (m,), (W, m)",
            )
        if not audible(body.omega_rad_s, body.decay_per_s, bank.sr).all():
            raise AudioError(
                "a mode beyond half the sample rate, overdamped or not finite", "keep the modes that `audible` names"
            )
        sizes.append(m)
    padded = [-(-m // LANES) * LANES for m in sizes]
    starts = np.concatenate([[0], np.cumsum(padded)]).astype(np.int64)
    total = int(starts[-1])
    place = np.concatenate([np.arange(m) + starts[i] for i, m in enumerate(sizes)]) if sizes else np.zeros(0, np.int64)
    place = place.astype(np.int64)
    s = np.zeros(total, complex)
    pole, block = np.zeros(total, complex), np.zeros(total, complex)
    quadrature, weight, held = np.zeros(total), np.zeros((sets, total), complex), np.zeros(total, bool)
    bend, damping_growth, power = np.zeros(total), np.zeros(total), np.ones(total)
    if len(place):
        omega, decay = np.concatenate([x.omega_rad_s for x in bodies]), np.concatenate([x.decay_per_s for x in bodies])
        step = (-decay + 1j * omega) / bank.sr
        s[place], pole[place], block[place] = step, np.exp(step), np.exp(BLOCK * step)
        held[place] = np.repeat([x.held for x in bodies], sizes)
        bend[place], damping_growth[place] = (
            np.concatenate([_or_zero(getattr(x, name), m) for x, m in zip(bodies, sizes, strict=True)])
            for name in ("bend", "damping_growth")
        )
        power[place] = np.repeat([x.damping_growth_power for x in bodies], sizes)
        onset = (1 + 1j * decay / omega) * np.where(held[place], np.expm1(step) / step, 1.0)
        quadrature[place] = np.where(held[place], onset.imag / onset.real, decay / omega)
        weight[:, place] = flushed(
            np.concatenate([x.weight for x in bodies], axis=1) * np.where(held[place], onset.real, 1.0)
        )
    observed = np.array([[bool(np.any(x.weight[w])) for x in bodies] for w in range(sets)], bool).reshape(
        sets, len(bodies)
    )
    grown = Bank(
        bank.sr,
        np.concatenate([bank.offset, bank.offset[-1] + starts[1:]]),
        np.concatenate([bank.count, np.array(sizes, np.int64)]),
        _joined(bank.log_pole, s),
        _joined(bank.pole, pole),
        _joined(bank.block, block),
        np.concatenate([bank.quadrature, quadrature]),
        np.stack([_joined(bank.weight[w], weight[w]) for w in range(sets)]).reshape(sets, -1),
        np.concatenate([bank.observed, observed], axis=1),
        np.concatenate([bank.held, held]),
        np.concatenate([bank.bend, bend]),
        np.concatenate([bank.damping_growth, damping_growth]),
        np.concatenate([bank.power, power]),
        np.concatenate(
            [bank.bent, np.array([x.bend is not None or x.damping_growth is not None for x in bodies], bool)]
        ),
    )
    state = state.copy()
    silent, flags = np.zeros(total, complex), np.zeros(len(bodies), bool)
    return grown, replace(
        state,
        z=_joined(state.z, silent),
        driven=_joined(state.driven, silent),
        sound=np.concatenate([state.sound, np.zeros((sets, len(bodies), BLOCK))], axis=1),
        ringing=np.concatenate([state.ringing, flags]),
        is_driven=np.concatenate([state.is_driven, flags]),
        tiled=np.concatenate([state.tiled, flags]),
        pole=_joined(state.pole, pole),
        block=_joined(state.block, block),
    )


def silence(state: BankState) -> BankState:
    """The state at the same sample with nothing ringing and no strike under way."""
    state = state.copy()
    for name in ("z", "driven", "sound", "ringing", "is_driven", "tiled"):
        getattr(state, name)[...] = 0
    return replace(state, pending=Pending.none())


def advance(
    bank: Bank,
    state: BankState,
    n: int,
    strikes: Sequence[Strike] = (),
    forces: Sequence[Force] = (),
    progress: Array | None = None,
) -> Array:
    """The next n samples: y (W, b, n). Changes ``state`` in place.

    strikes: those that become known now; each starts after the previous call's last sample, in any call before or at
    which it sounds. forces: for exactly these n samples; progress (n,): where between gain0 and gain1 each sample lies.
    Strikes and forces of a body are added in order of start and of the list. Samples below 1e-30 are 0. Raises
    AudioError on wrong shapes, NaN, or a strike in the past.
    """
    if n < 0 or len(state.ringing) != bank.body_count or len(state.z) != 2 * len(bank.quadrature):
        raise AudioError(
            f"{n} samples for a state of {len(state.ringing)} bodies and a bank of {bank.body_count}",
            "advance the state that `append` returned",
        )
    pending = with_strikes(
        state.pending, strikes, state.at, bank.offset, bank.count, bank.log_pole, bank.quadrature, bank.held
    )
    force_of, force, gain0, gain1, gain_at = _flat_forces(bank, n, forces)
    along = np.zeros(n) if progress is None else np.ascontiguousarray(progress, float)
    if along.shape != (n,) or not np.isfinite(along).all():
        raise AudioError(f"progress of shape {along.shape} for {n} samples", "give a finite number for each sample")
    out = np.zeros((bank.weight.shape[0], bank.body_count, n))
    done = np.zeros(len(pending.body), bool)
    bank_kernel.advance(
        state.at, out, bank.offset, bank.count, state.pole, state.block, bank.log_pole, bank.bend,
        bank.damping_growth, bank.power, bank.bent, bank.quadrature, bank.weight, bank.observed,
        state.z, state.driven, state.sound, state.ringing, state.is_driven, state.tiled, FLOOR**2,
        np.searchsorted(pending.body, np.arange(bank.body_count + 1)), pending.count, pending.whole,
        pending.delta, pending.phase, pending.upcoming, pending.first, pending.impulse, pending.impulse_at,
        pending.rows.reshape(-1), pending.rows_at, done, force_of, force, gain0, gain1, gain_at, along, 1.0 / bank.sr,
    )  # fmt: skip
    state.at += n
    state.pending = without(pending, done, bank.offset)
    return out


def _or_zero(values: Array | None, m: int) -> Array:
    if values is None:
        return np.zeros(m)
    if np.shape(values) != (m,) or not np.isfinite(values).all():
        raise AudioError(
            f"bend or damping growth of shape {np.shape(values)} for {m} modes", "give a finite number for each mode"
        )
    return np.asarray(values, float)


def _joined(flat: Array, more: Array) -> Array:
    """A flat array, real parts first, with the complex values ``more`` behind it."""
    half = len(flat) // 2
    return np.concatenate([flat[:half], more.real, flat[half:], more.imag])


def _flat_forces(bank: Bank, n: int, forces: Sequence[Force]) -> tuple[Array, Array, Array, Array, Array]:
    """Forces sorted by body (stable): segments (b+1,), signals (p, n), flat gains at both ends, and where each begins
    (p,).
    """
    if not forces:
        none = np.zeros(0)
        return np.zeros(bank.body_count + 1, np.int64), np.zeros((0, n)), none, none, np.zeros(0, np.int64)
    ordered = sorted(forces, key=lambda force: force.body)
    bodies = [force.body for force in ordered]
    for force in ordered:
        if np.shape(force.force_n) != (n,):
            raise AudioError(f"a force on body {force.body} of shape {np.shape(force.force_n)}", f"give {n} samples")
    signals = np.stack([force.force_n for force in ordered]).astype(float)
    if not np.isfinite(signals).all():
        raise AudioError("a force that is not finite", "look at the surface model's input: loads, speeds, profile")
    gain0, at = padded_gains(bank.offset, bank.count, bodies, [force.gain0 for force in ordered], "force")
    gain1, _ = padded_gains(bank.offset, bank.count, bodies, [force.gain1 for force in ordered], "force")
    return np.searchsorted(np.array(bodies, np.int64), np.arange(bank.body_count + 1)), signals, gain0, gain1, at
