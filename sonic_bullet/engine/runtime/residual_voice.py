"""Residuals: lines in the bank, and grains of noise for strikes and friction, of bodies whose material has one.

    tables of a step -> ForcePulse, Drive: strikes and friction by value, for observers; the run time does without
    Resonator + Residual -> ResidualVoice: lines as further modes (each struck as the mode it follows is),
        a voice for the noise (residual.grains)
    ForcePulse -> a² of each pair of modes, at each sensor's weights -> Grain
        level, place and pulse as the modes have them
    Drive -> sections of force -> Grain

A line's weight is i·c/a times that of its mode: a quarter turn away, so that at one frequency powers add, as a residual
of powers requires. Where a mode's frequency or decay depends on its level, so do those of the lines that follow it. All
is in the bank's units (Pa·m, or what another sensor reads), before the sound path; no gain of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.engine.bank import ModeSet, audible
from sonic_bullet.engine.bank.resonator import Resonator, build_resonator
from sonic_bullet.engine.bank.rigid_motion import with_rigid
from sonic_bullet.engine.contact.pulse_shape import pulse_spectrum
from sonic_bullet.engine.residual.grains import Voice, make_voice, mixed_number, place_grains, vary_grains
from sonic_bullet.engine.residual.player import (
    SECTION,
    FrictionHistory,
    Grain,
    add_grains,
    cut_rubbed_sections,
    section_grain,
)
from sonic_bullet.engine.residual.transfer import StruckModes
from sonic_bullet.machine.identity_cache import WhileAlive
from sonic_bullet.records import Air, Array, Body, ModalModel, Residual
from sonic_bullet.signal.elementary import complex_size

if TYPE_CHECKING:
    from sonic_bullet.engine.runtime.synthesis_state import Setup, State
    from sonic_bullet.engine.runtime.tables import StepScratch

Rubs = Mapping[tuple[int, int, int], FrictionHistory]
"""By lower body, higher body and side: the force so far."""


@dataclass(frozen=True, slots=True, eq=False)
class ForcePulse:
    """One strike.

    Attributes
    ----------
    low, high
        Body indices.
    start_s
        After the start of the step being rendered.
    length_s
        Of the pulse.
    flat
        Half-sine, not Hertz'.
    impulse_n_s : (3,)
        World, on low.
    modes_low, modes_high : (m,)
        Uᵀj of the whole impulse in N·s/√kg.
    share
        Transmitted fraction of all these (contact.pulse_shape.compliance).
    """

    low: int
    high: int
    start_s: float
    length_s: float
    flat: bool
    impulse_n_s: Array
    modes_low: Array
    modes_high: Array
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """A force signal on one pair, linear between the step's ends.

    Attributes
    ----------
    force_n : (n,)
        On the lower body along the direction, its negative on the higher.
    gain0, gain1
        Uᵀ on the modes of both bodies, each (m,) a newton.
    direction0, direction1 : (3,)
        On the lower body, world.
    """

    low: int
    high: int
    force_n: Array
    gain0: tuple[Array, Array]
    gain1: tuple[Array, Array]
    direction0: Array
    direction1: Array


def pulses_of(
    scratch: StepScratch, found: int, modes: Array, begin_s: float, after_s: float
) -> list[tuple[float, ForcePulse]]:
    """Return the step's strikes, each with the time from which its start counts. modes (b,): of each body.

    begin_s, after_s: start of the step and of the one after it, for which a strike may have been found already.
    """
    pulses = []
    for row, modal_impulse in zip(scratch.pulse[:found], scratch.modal_impulse[:found], strict=True):
        low, high = (int(body) for body in row["body"])
        one = ForcePulse(
            low, high, float(row["start_s"]), float(row["length_s"]), bool(row["flat"]), row["impulse_n_s"].copy(),
            modal_impulse[0, : modes[low]].copy(), modal_impulse[1, : modes[high]].copy(),
            float(row["transmitted_fraction"]),
        )  # fmt: skip
        pulses.append((after_s if row["ahead"] else begin_s, one))
    return pulses


def drives_of(scratch: StepScratch, drives: int, modes: Array, samples: int) -> list[Drive]:
    """Return the step's friction. modes (b,): of each body; samples: of the step."""
    force = scratch.force[: len(scratch.slot) * samples].reshape(len(scratch.slot), samples)
    found = []
    for d in range(drives):
        low, high = (int(body) for body in scratch.body[d])
        gain0, gain1 = (
            (gain[d, 0, : modes[low]].copy(), gain[d, 1, : modes[high]].copy())
            for gain in (scratch.gain0, scratch.gain1)
        )
        along = scratch.direction0[d].copy(), scratch.direction1[d].copy()
        found.append(Drive(low, high, force[d].copy(), gain0, gain1, *along))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class ResidualVoice:
    """One body's residual.

    Attributes
    ----------
    lines : for the bank
    follows : (l,) the resonator's mode that each is struck as
    group : (m,) the voice's pair of each mode, or -1
    """

    voice: Voice
    lines: ModeSet
    follows: Array
    group: Array


def build_residual_voice(resonator: Resonator, sr: int, air: Air) -> ResidualVoice | None:
    """Build a body's residual for playback, or None where it has none, or no modes to follow."""
    material, model = resonator.body.material, resonator.body.model
    if (
        material is None
        or material.residual is None
        or model is None
        or not resonator.mode_count
        or not resonator.weight.any()
    ):
        return None
    voice = _voice(model, material.residual, air, sr)
    group = np.empty(resonator.mode_count, np.int64)
    group[np.argsort(resonator.omega_rad_s, kind="stable")] = voice.pairs.group
    line, mode = [], []
    for i, pair in enumerate(voice.lines.follows):
        members = np.flatnonzero(group == pair)
        line += [i] * len(members)
        mode += list(members)
    at, follows = np.array(line, np.int64), np.array(mode, np.int64)
    omega, decay = 2 * np.pi * voice.lines.freq_hz[at], voice.lines.decay_per_s[at]
    keep = audible(omega, decay, sr)
    at, follows = at[keep], follows[keep]
    weight = 1j * voice.lines.ratio[at] * resonator.weight[:, follows]
    bend, damping_growth = (None if x is None else x[follows] for x in (resonator.bend, resonator.damping_growth))
    return ResidualVoice(
        voice,
        ModeSet(
            omega[keep],
            decay[keep],
            weight,
            bend=bend,
            damping_growth=damping_growth,
            damping_growth_power=resonator.damping_growth_power,
        ),
        follows,
        group,
    )


@WhileAlive
def _voice(model: ModalModel, residual: Residual, air: Air, sr: int) -> Voice:
    """Build a voice, once for bodies that share residual and model (records are compared by identity).

    Pairs are formed by the modes' mean square over the surface.
    """
    s = build_resonator(Body(0, -1, 0, "", 0.0, np.zeros((3, 3)), model=model), (), sr, air)
    order = np.argsort(s.omega_rad_s, kind="stable")
    shape = np.sqrt((s.shape.astype(float) ** 2).sum(axis=1).mean(axis=0)) if len(s.shape) else np.ones(s.mode_count)
    loud = complex_size(s.weight[0]) if s.weight[0].any() else np.ones(s.mode_count)
    return make_voice(
        residual, StruckModes(s.omega_rad_s[order] / (2 * np.pi), s.decay_per_s[order], (loud * shape)[order]), sr
    )


@lru_cache(maxsize=2)
def _pulse_table(flat: bool) -> tuple[Array, Array]:
    f_tau = np.linspace(0.0, 32.0, 1281)
    return f_tau, pulse_spectrum(f_tau, flat=flat)


def pulse(f_tau: Array, flat: bool) -> Array:
    """Interpolate |F̂| of a force pulse at products fτ (k,), relative to 0 Hz."""
    return np.asarray(np.interp(f_tau, *_pulse_table(flat), right=0.0))


def struck_power(voice: ResidualVoice, weight: Array, modal_impulse: Array) -> Array:
    """Compute a² (p,) at the onset of the pairs' modes, for Uᵀj (m,) of an impulse and the modes' weights (m,)."""
    used = voice.group >= 0
    return np.bincount(
        voice.group[used],
        ((weight.real**2 + weight.imag**2) * modal_impulse**2)[used],
        len(voice.voice.pairs.target_hz),
    )


def impact_grains(
    impact: ForcePulse,
    step_start_s: float,
    resonators: Sequence[Resonator],
    voice: Sequence[ResidualVoice | None],
    sr: int,
    earliest: int,
    seed: int,
) -> list[Grain]:
    """Make the grains of one strike on both bodies."""
    start = max((step_start_s + impact.start_s) * sr, float(earliest))
    first, grains = int(np.ceil(start)), []
    for body, modal_impulse in ((impact.low, impact.modes_low), (impact.high, impact.modes_high)):
        mine = voice[body]
        if mine is None:
            continue
        who = resonators[body].body
        number = mixed_number(seed, who.body_id, who.link + 1, who.epoch, int(start * 1048576))
        for w, weight in enumerate(resonators[body].weight):
            if weight.any():
                pair, level = place_grains(
                    mine.voice,
                    struck_power(mine, weight, impact.share * modal_impulse),
                    impact.length_s,
                    impact.flat,
                    pulse,
                )
                if level > 0:
                    grains.append(Grain(first, w, body, vary_grains(pair, level, number)))
    return grains


def friction_grains(
    rubs: Rubs,
    drives: Sequence[Drive],
    resonators: Sequence[Resonator],
    voice: Sequence[ResidualVoice | None],
    number_of: Array,
    at: int,
    n: int,
    seed: int,
) -> tuple[list[Grain], Rubs]:
    """Make the grains of friction sections that end within the n samples from ``at`` on; also return the open sections.

    number_of (b,): of each body in the log, which makes its partners' noise differ.
    """
    driven = {(d.low, d.high, side): d for d in drives for side in (0, 1) if voice[(d.low, d.high)[side]] is not None}
    grains, kept = [], {}
    for key in sorted(set(rubs) | set(driven)):
        drive, body = driven.get(key), key[key[2]]
        sections, state = cut_rubbed_sections(rubs.get(key), None if drive is None else drive.force_n, at, n)
        mine, who = voice[body], resonators[body].body
        if mine is None:
            continue
        gain = rubs[key].gain if drive is None else drive.gain1[key[2]]
        if state is not None:
            kept[key] = replace(state, gain=gain)
        for number, force_n in sections:
            own = mixed_number(seed, who.body_id, who.link + 1, who.epoch, int(number_of[key[1 - key[2]]]), number)
            for w, weight in enumerate(resonators[body].weight):
                sample = (
                    section_grain(mine.voice, force_n, struck_power(mine, weight, gain), own)
                    if weight.any()
                    else np.zeros(0)
                )
                if len(sample):
                    grains.append(Grain((number + 2) * SECTION, w, body, sample))
    return grains, kept


def add_residuals(setup: Setup, state: State, step: Array, found: int, drives: int) -> None:
    """Add the residuals' grains of the step to the modes."""
    first, n, sr, room = int(step["sample"]), int(step["count"]), setup.sr, state.scratch
    modes = state.table.bodies["modes"]
    pulses = pulses_of(room, found, modes, float(step["begin_s"]), float(step["after_s"]))
    rubs = drives_of(room, drives, modes, n)
    more, state.rubs = friction_grains(
        state.rubs, rubs, state.resonators, state.voices, state.body, first, n, setup.seed
    )
    struck = (
        grain
        for begin_s, one in pulses
        for grain in impact_grains(one, begin_s, state.resonators, state.voices, sr, first, setup.seed)
    )
    state.grains = (*state.grains, *struck, *more)
    state.grains = add_grains(room.source[:, :, :n], state.grains, first)
    room.sounds[:, 0] = 1  # whatever rings, a grain may have sounded


def with_lines(resonator: Resonator, voice: ResidualVoice | None) -> ModeSet:
    """Return a body's modes for the bank, followed by the lines of its residual, and its rigid motions."""
    s = resonator
    modes = ModeSet(
        s.omega_rad_s, s.decay_per_s, s.weight, s.bend, s.damping_growth, s.damping_growth_power, s.translation
    )
    if voice is None:
        return with_rigid(modes, s.rigid_columns, s.body.sounding_gain)
    lines = voice.lines
    bend, growth = (
        None if mine is None or more is None else np.concatenate([mine, more])
        for mine, more in ((s.bend, lines.bend), (s.damping_growth, lines.damping_growth))
    )
    modes = ModeSet(
        np.concatenate([s.omega_rad_s, lines.omega_rad_s]),
        np.concatenate([s.decay_per_s, lines.decay_per_s]),
        np.concatenate([s.weight, lines.weight], axis=1),
        bend,
        growth,
        s.damping_growth_power,
        s.translation,
    )
    return with_rigid(modes, s.rigid_columns, s.body.sounding_gain)
