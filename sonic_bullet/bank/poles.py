"""Poles of bodies whose contacts change, from the next block on (src/bank/poles.hpp).

    coming (8, m): d and ω a sample, d/ω, e^s and e^{256 s}, separation -> law, pole, block at the next block's start

Block starts lie on the grid of absolute time: any split into calls gives the same bits. ½|z|² is a mode's energy
whatever its pole is, and z continues as it is: no change of poles adds energy or causes a jump.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from sonic_bullet._engine import take_coming
from sonic_bullet.bank.layout import BLOCK
from sonic_bullet.records import Array
from sonic_bullet.signal.elementary import complex_exp

if TYPE_CHECKING:
    from sonic_bullet.bank.instrument import Bank, BankState


def set_poles(bank: Bank, state: BankState, b: int, step: Array, separation: Array | None = None) -> None:
    """Set other poles (m,), s = (-d + iω)/sr, of body b's modes from the next block's start.

    At once where nothing of it is active. separation (m,): fraction of a contact's load that a modal velocity of 1
    removes; None: none.
    """
    start, stop, m = (int(bank.body[b][name]) for name in ("start", "stop", "columns"))
    lanes = slice(start, start + m)
    pole, block = complex_exp(step), complex_exp(BLOCK * step)
    own = bank.law[:3, lanes]
    quadrature = np.where((step.real == own[0]) & (step.imag == own[1]), own[2], -step.real / step.imag)
    state.coming[:, start:stop] = 0.0
    state.coming[:7, lanes] = step.real, step.imag, quadrature, pole.real, pole.imag, block.real, block.imag
    state.coming[7, lanes] = 0.0 if separation is None else separation
    now = state.ringing[b]
    now["fresh"] = 1
    if not (now["ringing"] or now["driven"] or now["tiled"] or now["strike"] >= 0):
        take_coming(b, start, stop, state.ringing, state.law, state.pole, state.block, state.coming)
