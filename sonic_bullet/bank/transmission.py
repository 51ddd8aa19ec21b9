"""Transmission: modes of one body that sound at another that it touches.

    transmissions (b, J): up to J partners of each body;  set j·W + w of weights at the lanes of body b:
        y[w, to, n] += ramp[n] Σ Re(weight z[n])

A mode of coupled bodies moves all of them. Its shape on the others is the weight here, its pole the coupled one
(`poles`), so a transmission has no memory of its own. It begins and ends where a block of absolute time does, fading in
over its first block and out over its last: nothing jumps, and any split into calls gives the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sonic_bullet._engine import TRANSMISSION_PHASES
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.bank.instrument import Bank, BankState

MOST_PARTNERS = 8
"""Partners to which a body transmits at a time, those that fade out among them."""


class _Phases(NamedTuple):
    """States of a transmission."""

    off: int
    steady: int
    coming: int  # from the next block on rising
    rising: int
    leaving: int  # from the next block on falling
    falling: int
    brief: int  # rises and is to fall


PHASE = _Phases(**TRANSMISSION_PHASES)

SILENCED = np.array([PHASE.off, PHASE.steady, PHASE.steady, PHASE.steady, PHASE.off, PHASE.off, PHASE.off])
"""State that each becomes where nothing sounds any more, and nothing has to fade."""


def set_transmissions(bank: Bank, state: BankState, b: int, wanted: Mapping[int, Array]) -> None:
    """Set what body b transmits from the next block's start, at once where nothing of it is active.

    wanted: weights (W, m) complex by partner. Earlier ones end. Where there are too few places, the first of
    ``wanted`` have them.
    """
    # state that each becomes where it is to end
    leaves = np.array([PHASE.off, PHASE.leaving, PHASE.off, PHASE.brief, PHASE.leaving, PHASE.falling, PHASE.brief])
    start, m, modes = int(bank.body[b]["start"]), int(bank.body[b]["columns"]), bank.law.shape[1]
    now, mine, sets = state.ringing[b], state.transmissions[b], len(bank.observed)
    loud = now["ringing"] or now["driven"] or now["tiled"] or now["strike"] >= 0
    mine["phase"] = leaves[mine["phase"]] if loud else PHASE.off
    places = np.flatnonzero(mine["phase"] == PHASE.off)
    for j, (to, weight) in zip(places, wanted.items(), strict=False):
        mine[j] = to, PHASE.coming if loud else PHASE.steady
        rows = state.transmission_weight[j * sets : (j + 1) * sets]
        rows[:, start : start + m], rows[:, modes + start : modes + start + m] = weight.real, weight.imag
    now["transmissions"] = np.count_nonzero(mine["phase"])
