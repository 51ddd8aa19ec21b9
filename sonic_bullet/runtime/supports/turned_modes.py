"""Pairs of modes of one frequency, turned to the axes of a body's contacts: all that has a lane for each mode turns.

    ψ' = ψ R,  z' = Rᵀ z,  (Uᵀj)' = Rᵀ Uᵀj,  w' = w R         of each pair, R orthogonal: ½|z|² and Σ w z stay

The free modes of a round body are any two of a pair's plane: which two, a mesh decides. At a contact one motion moves
it and decays, another has a node there. With them as the modes, what a strike leaves ringing does not hang on the mesh.
From one turn to the next all turns by Sᵀ, S = R_oldᵀ R_new; without contacts R is the identity.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import matrix_product

if TYPE_CHECKING:
    from sonic_bullet.runtime.synthesis_state import State


def turn_lanes(values: Array, pairs: Array, step: Array) -> None:
    """Turn the last axis of values, in place: those at pairs (p,) and their neighbours by step (p, 2, 2)ᵀ."""
    one, other = values[..., pairs], values[..., pairs + 1]
    values[..., pairs] = one * step[:, 0, 0] + other * step[:, 1, 0]
    values[..., pairs + 1] = one * step[:, 0, 1] + other * step[:, 1, 1]


def turn_modes(state: State, b: int, turn: Array | None) -> None:
    """Turn the modes of body b to ``turn`` (m, m), which mixes neighbouring pairs alone; None: as they are free.

    A turn that is almost the present one changes nothing.
    """
    same_turn = 0.05  # largest element, in radians about, of a turn that is left out: cos² of it is 1 within 0.3 %
    m = state.resonators[b].mode_count
    old = state.table.turn_of(b)
    if (turn is None and old is None) or not len(state.resonators[b].mobility.pairs):
        return
    before, after = (np.eye(m) if one is None else one for one in (old, turn))
    pairs = np.flatnonzero((np.diag(before, 1) != 0) | (np.diag(after, 1) != 0))
    both = pairs[:, None] + np.arange(2)
    block = both[:, :, None], both[:, None]
    step = np.array(
        [matrix_product(one.T, other) for one, other in zip(before[block], after[block], strict=True)]
    ).reshape(-1, 2, 2)
    mixes = step[:, 0, 1] != 0
    if not mixes.any() or (turn is not None and np.abs(step - np.eye(2)).max() < same_turn):
        return
    _turn_state(state, b, pairs[mixes], step[mixes])
    state.table.turn(b, turn)
    state.changed()


def _turn_state(state: State, b: int, pairs: Array, step: Array) -> None:
    """Turn what the bank, the strikes and forces under way and the contacts' gains hold of a body."""
    now, start, modes = state.ringing, int(state.bank.body[b]["start"]), state.bank.law.shape[1]
    weight = state.bank.weight.copy()  # the bank is other states', too
    for part in (start, modes + start):
        for values in (now.z, now.driven, now.transmission_weight, weight):
            turn_lanes(values, part + pairs, step)
    state.bank = replace(state.bank, weight=weight)
    slot = int(now.ringing[b]["strike"])
    while slot >= 0:
        turn_lanes(now.rows[slot, :2], pairs, step)  # r, which holds the gain
        slot = int(now.strikes[slot]["next"])
    scratch, touching = state.scratch, state.pairs
    found, drives = scratch.count.tolist()
    active = touching.active[: touching.count[0]]
    for side in range(2):
        struck = np.flatnonzero(scratch.pulse["body"][:found, side] == b)
        driven = np.flatnonzero(scratch.body[:drives, side] == b)
        slots = active[touching.pair["body"][active, side] == b]
        mine = (scratch.modal_impulse, struck), (scratch.gain0, driven), (scratch.gain1, driven), (touching.gain, slots)
        for gains, rows in mine:
            for row in rows.tolist():
                turn_lanes(gains[row, side], pairs, step)
