"""Effect of resting contacts on a body: other poles while they last, and transmission to the bodies it touches.

    CONTACT_PATCH of a body's pairs -> touches: places on both bodies, springs of the regions that touch     (coupling)
        -> first_order -> poles, transmission to each partner, contact separation -> the bank, from its next block on

The driver chooses the bodies (`contact_patches.choose_bodies`): active ones whose contacts differ from those of their
poles. The modes of each body stay its own, with its poles, but pairs of one frequency turn to the contact's axes
(turned_modes); the small coupling of its other modes by the contacts is left out.
Lines of a residual take the change of the mode that they follow. Chains of bodies are not claimed: a body's poles use
its partners as they are free.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import bank
from sonic_bullet.bank.resonator import Resonator
from sonic_bullet.contact.coupling import CoupledModes
from sonic_bullet.contact.coupling.coupled_modes import build_system, uncoupled_modes
from sonic_bullet.contact.coupling.first_order import solve_system, times_real
from sonic_bullet.contact.load_splitting import SPAN
from sonic_bullet.records import Array
from sonic_bullet.runtime.supports.touches import collect_touches
from sonic_bullet.runtime.supports.turned_modes import turn_modes
from sonic_bullet.runtime.synthesis_state import State
from sonic_bullet.signal.elementary import complex_size

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

STOPPED = 0.05
"""Radians a sample beyond which the contacts have made a mode too fast to play, and its decay a sample then."""


@cache
def _blas() -> ThreadpoolController:
    """Return the controller of BLAS threads: on matrices of a hundred, more threads take seconds and change bits."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def update_poles(state: State, number: int) -> None:
    """Update the poles of the bodies that the driver wants, before step ``number`` rings."""
    many = any(one.user_api == "blas" and one.num_threads != 1 for one in _blas().lib_controllers)
    with _blas().limit(limits=1, user_api="blas") if many else nullcontext():
        for b in np.flatnonzero(state.support_state["wanted"]).tolist():
            state.support_state["wanted"][b] = 0
            _update_body(state, b, state.window.quaternion_xyzw[number % SPAN])


def couple_body(state: State, b: int, quaternion: Array) -> tuple[list[int], Array, CoupledModes]:
    """Compute a body's partners, the load (c,) on each of its touches, and its coupled modes.

    quaternion (b, 4): all bodies'.
    """
    partners, motions, load_n = collect_touches(state, b, quaternion)
    body, mobility = state.resonators[b].mobility, [state.resonators[p].mobility for p in partners]
    if not len(load_n):
        return partners, load_n, uncoupled_modes(body, mobility)
    system, row = build_system(body, mobility, motions)
    return partners, load_n, solve_system(body, mobility, system, row, len(load_n), state.table.turn_of(b))


def _update_body(state: State, b: int, quaternion: Array) -> None:
    partners, load_n, placed = couple_body(state, b, quaternion)
    free = _lanes(state, b)
    m = state.resonators[b].mode_count
    turn_modes(state, b, placed.turn if len(load_n) else None)
    if not len(load_n):
        bank.set_poles(state.bank, state.ringing, b, free)
        bank.set_transmissions(state.bank, state.ringing, b, {})
        return
    new = _audible((-placed.decay_per_s + 1j * placed.omega_rad_s) / state.bank.sr, free[:m])
    voice = state.voices[b]
    if voice is not None:
        new = np.concatenate([new, free[m : m + len(voice.follows)] + (new - free[:m])[voice.follows]])
    new = np.concatenate([new, free[len(new) :]])  # rigid motions
    separation = np.zeros(len(free))
    separation[:m] = np.nan_to_num(np.abs(placed.force_n_s) / load_n[:, None]).max(axis=0)
    bank.set_poles(state.bank, state.ringing, b, new, separation)
    bank.set_transmissions(
        state.bank, state.ringing, b, dict(_transmitted_weights(state, b, partners, placed, len(free)))
    )


def _lanes(state: State, b: int) -> Array:
    """Return s a sample (m + lines,) of a body without contacts."""
    row = state.bank.body[b]
    lanes = slice(int(row["start"]), int(row["start"] + row["columns"]))
    step: Array = state.bank.law[0, lanes] + 1j * state.bank.law[1, lanes]
    return step


def _audible(new: Array, free: Array) -> Array:
    """Limit poles to what the bank can play: a mode that the contacts stop or make too fast decays within a block."""
    # radians a sample beyond which the contacts have made a mode too fast to play, and its decay a sample then
    fastest_turn = 3.0
    stopped = np.minimum(free.real, -STOPPED) + 1j * np.minimum(free.imag, fastest_turn)
    fast = ~np.isfinite(new) | (new.imag > fastest_turn) | (new.imag <= 1e-6) | (-new.real > new.imag)
    return np.asarray(np.where(fast, stopped, np.minimum(new.real, 0.0) + 1j * new.imag))


def _transmitted_weights(
    state: State, b: int, partners: list[int], placed: CoupledModes, columns: int
) -> Iterator[tuple[int, Array]]:
    """Yield weights (W, columns) of the transmission to each audible partner.

    Audible: more than 0.3 of the body's own sound in some mode, of those within 60 dB of its loudest,
    both without gains.
    """
    least_transmitted = 0.3  # of a mode's own weight: a weaker transmission would add 0.4 dB to it, and is left out
    faintest = 1e-3  # of a body's loudest mode: 60 dB below, it is what is left when all else has decayed
    own = complex_size(times_real(state.resonators[b].weight[:1], placed.turn)[0]) / state.resonators[b].body.gain
    least = np.maximum(least_transmitted * own, faintest * own.max(initial=0.0))
    for i, p in enumerate(partners):
        if not state.resonators[p].weight.shape[1]:
            continue
        weight = np.zeros((len(state.bank.observed), columns), complex)
        weight[:, : len(own)] = transmitted_weight(state.resonators[p], placed, i)
        transmitted = complex_size(weight[0, : len(own)]) / state.resonators[p].body.gain
        if (transmitted > least).any() or np.abs(weight[1:]).max(initial=0.0) > 0:
            yield p, weight


def transmitted_weight(partner: Resonator, placed: CoupledModes, number: int) -> Array:
    """Compute weights (W, m) of a body's coupled modes in the sound of a partner, ``number`` of its partners.

    Pressure is iωρ₀ times velocity: it is proportional to the frequency at which a mode is moved; its other radiation
    is taken at the mode's own.
    """
    weight = partner.weight.copy()
    weight[0] /= partner.omega_rad_s
    weight = placed.transmitted_weight(number, weight)
    weight[0] *= placed.omega_rad_s
    return weight
