"""Pairs of modes of one frequency, turned to the axes of a body's contacts: all that has a lane for each mode turns.

    ψ' = ψ R,  z' = Rᵀ z,  (Uᵀj)' = Rᵀ Uᵀj,  w' = w R         of each pair, R orthogonal: ½|z|² and Σ w z stay

The free modes of a round body are any two of a pair's plane: which two, a mesh decides. At a contact one motion moves
it and decays, another has a node there. With them as the modes, what a strike leaves ringing does not hang on the mesh.
From one turn to the next all turns by Sᵀ, S = R_oldᵀ R_new (src/contact/coupling/turned_modes.hpp); without contacts R
is the identity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.runtime.synthesis_state import State

IDENTITY = np.zeros((0, 0))


def turn_modes(state: State, b: int, turn: Array | None) -> None:
    """Turn the modes of body b to ``turn`` (m, m), which mixes neighbouring pairs alone; None: as they are free.

    A turn that is almost the present one changes nothing.
    """
    old, pairs = state.table.turn_of(b), state.resonators[b].mobility.pairs
    if (turn is None and old is None) or not len(pairs):
        return
    before, after = (IDENTITY if one is None else one for one in (old, turn))
    weights = state.bank.weight, state.ringing.transmission_weight
    if state.engine().turn_modes(b, pairs, before, after, *weights) and state.table.turn(b, turn, pairs):
        state.changed()
