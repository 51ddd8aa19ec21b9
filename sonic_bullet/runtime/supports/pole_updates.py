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
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet import bank
from sonic_bullet._engine import FLAT_CURVATURE, SIZELESS_M, STRUCK_FLAT
from sonic_bullet.bank.resonator import Resonator
from sonic_bullet.contact.coupling import (
    ContactPoint,
    ContactSpring,
    CoupledModes,
    Region,
    contact_spring,
    first_order,
)
from sonic_bullet.contact.coupling.first_order import times_real
from sonic_bullet.contact.load_splitting import SPAN
from sonic_bullet.records import Array
from sonic_bullet.runtime.supports.patch_points import placed_points
from sonic_bullet.runtime.supports.turned_modes import turn_modes
from sonic_bullet.runtime.synthesis_state import State
from sonic_bullet.signal.elementary import complex_size, matrix_product, symmetric_eigenpairs

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


def couple_body(state: State, b: int, quaternion: Array) -> tuple[list[int], list[ContactPoint], Array, CoupledModes]:
    """Compute a body's partners, its touches, the load (c,) on each, and its coupled modes.

    quaternion (b, 4): all bodies'.
    """
    partners, touches, load_n = _touches(state, b, quaternion)
    mobility = [state.resonators[p].mobility for p in partners]
    modes = first_order(state.resonators[b].mobility, mobility, touches, state.table.turn_of(b))
    return partners, touches, load_n, modes


def _update_body(state: State, b: int, quaternion: Array) -> None:
    partners, touches, load_n, placed = couple_body(state, b, quaternion)
    free = _lanes(state, b)
    m = state.resonators[b].mode_count
    turn_modes(state, b, placed.turn if touches else None)
    if not touches:
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


def _touches(state: State, b: int, quaternion: Array) -> tuple[list[int], list[ContactPoint], Array]:
    """Return a body's partners, its touches, and the load on each (c,)."""
    partners: list[int] = []
    touches, loads = [], []
    pairs = state.pairs
    active = pairs.active[: pairs.count[0]]
    touching = (pairs.pair["body"][active] == b).any(axis=1) & (pairs.patch["count"][active] > 0)
    for slot in active[touching].tolist():
        patch, both = pairs.patch[slot], pairs.pair["body"][slot].tolist()
        side = both.index(b)
        other = both[1 - side]
        if other not in partners:
            partners.append(other)
        if not sum(state.resonators[one].side.compliance_per_pa for one in both):
            continue  # both rigid: their materials are unknown
        turns = np.stack([state.resonators[one].mobility.turn for one in both])
        placed = placed_points(state.table, quaternion, patch, pairs.pair["body"][slot], turns)
        own, there = placed.moves[side], placed.moves[1 - side]
        load = patch["load_n"][: patch["count"]]
        for i, spring in enumerate(_springs(state, both, patch, placed.curvature_per_m, placed.off_m, load)):
            touches.append(ContactPoint(partners.index(other), own[i], there[i], spring))
            loads.append(load[i])
    return partners, touches, np.array(loads)


def _springs(
    state: State, both: list[int], patch: Array, curvature: Array, off_m: float, load: Array
) -> Iterator[ContactSpring]:
    """Yield the spring of each of a pair's points: of its part of one region, or of a region of its own.

    off_m: distance of the points' middle from the surfaces.
    """
    sides = state.resonators[both[0]].side, state.resonators[both[1]].side
    sizes = [float(row["size_m"]) for row in state.table.bodies[both] if row["volume_m3"] > 0]
    size = min(sizes, default=SIZELESS_M)
    region = _one_region(patch["point_m"][: patch["count"], 0], float(curvature.mean()), off_m, size)
    whole = float(load.sum())
    slips = any(state.resonators[one].body.dynamics.get("lateralFriction") == 0 for one in both)  # μ is their product
    if region is not None:
        spring = _gripped(contact_spring(region, sides, whole), slips=slips)
        yield from (spring.share(float(n) / whole) for n in load)
        return
    for n, bent in zip(load.tolist(), curvature.tolist(), strict=True):
        small = STRUCK_FLAT * size
        point = (
            Region((small, small), (0.0, 0.0)) if bent * size <= FLAT_CURVATURE else Region((0.0, 0.0), (bent, bent))
        )
        yield _gripped(contact_spring(point, sides, n), slips=slips)


def _gripped(spring: ContactSpring, *, slips: bool) -> ContactSpring:
    """Return a spring as friction holds it: without any, nothing is held sideways [Mindlin 1949: what sticks is]."""
    slippery = 1e-9  # of its normal spring: what holds two bodies sideways that have no friction
    return replace(spring, tangential_n_m=slippery * spring.normal_n_m) if slips else spring


def _one_region(point_m: Array, curvature_per_m: float, off_m: float, size_m: float) -> Region | None:
    """Return the line or face that touches between a pair's points (c, 3); None where there is none."""
    # of the spread of a pair's points: where their middle is nearer than this to a surface, all between them touches
    on_point = 0.02
    narrow = 0.1  # least width of a face that touches over its length: where two corners alone are known
    middle = point_m - point_m.sum(axis=0) / len(point_m)
    spread = np.sqrt(((middle.max(axis=0) - middle.min(axis=0)) ** 2).sum())
    if spread < STRUCK_FLAT * size_m or off_m > on_point * spread:
        return None
    axes = symmetric_eigenpairs(matrix_product(middle.T, middle))[1][:, ::-1]  # longest first
    half = np.abs(matrix_product(middle, axes)).max(axis=0)
    if curvature_per_m * size_m > FLAT_CURVATURE:  # mean of both principal curvatures, of which a line has one
        return Region((float(half[0]), 0.0), (0.0, 2 * curvature_per_m))
    return Region((float(half[0]), float(max(half[1], narrow * half[0]))), (0.0, 0.0))
