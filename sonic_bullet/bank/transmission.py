"""Transmission: modes of one body that sound at another that it touches.

    transmissions (b, J): up to J partners of each body;  set j·W + w of weights at the lanes of body b:
        y[w, to, n] += ramp[n] Σ Re(weight z[n])

A mode of coupled bodies moves all of them. Its shape on the others is the weight here, its pole the coupled one
(`poles`), so a transmission has no memory of its own. It begins and ends where a block of absolute time does, fading in
over its first block and out over its last: nothing jumps, and any split into calls gives the same bits.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from sonic_bullet.bank.kernels import uncounted
from sonic_bullet.bank.layout import FLUSH
from sonic_bullet.bank.tile import BLOCK
from sonic_bullet.records import Array

if TYPE_CHECKING:
    from sonic_bullet.bank.instrument import Bank, BankState

MOST_PARTNERS = 8
"""Partners to which a body transmits at a time, those that fade out among them."""


class _Phases(NamedTuple):
    """States of a transmission."""

    off: int = 0
    steady: int = 1
    coming: int = 2  # from the next block on rising
    rising: int = 3
    leaving: int = 4  # from the next block on falling
    falling: int = 5
    brief: int = 6  # rises and is to fall


PHASE = _Phases()

TRANSMISSION = np.dtype([("to", "i8"), ("phase", "i8")], align=True)
SILENCED = np.array([PHASE.off, PHASE.steady, PHASE.steady, PHASE.steady, PHASE.off, PHASE.off, PHASE.off])
"""State that each becomes where nothing sounds any more, and nothing has to fade."""


@uncounted
def move_on(b, bank):  # pragma: no cover - compiled
    """Advance the transmissions of body b at the begin of its block."""
    left, transmissions = 0, bank.transmissions
    for j in range(transmissions.shape[1] if bank.ringing[b].transmissions else 0):
        phase = transmissions[b, j].phase
        if phase == PHASE.coming:
            phase = PHASE.rising
        elif phase == PHASE.rising:
            phase = PHASE.steady
        elif phase in (PHASE.leaving, PHASE.brief):
            phase = PHASE.falling
        elif phase == PHASE.falling:
            phase = PHASE.off
        transmissions[b, j].phase = phase
        left += phase != PHASE.off
    bank.ringing[b].transmissions = left


@uncounted
def sounds(phase):  # pragma: no cover - compiled
    """Return whether a transmission is active."""
    return phase not in (PHASE.off, PHASE.coming)


@uncounted
def last_set(b, bank):  # pragma: no cover - compiled
    """Return the last set of weights that reads body b; 0 where none does."""
    last, sets = 0, len(bank.observed)
    for w in range(sets):
        if bank.observed[w, b]:
            last = w
    if bank.ringing[b].transmissions:
        for j in range(bank.transmissions.shape[1]):
            if sounds(bank.transmissions[b, j].phase):
                last = (j + 2) * sets - 1
    return last


@uncounted
def transmit(b, j, w, stretch, values, bank, transmitted):  # pragma: no cover - compiled
    """Add the values of a `layout.Stretch` of body b's j-th transmission, set w, to its partner."""
    phase, to = bank.transmissions[b, j].phase, bank.transmissions[b, j].to
    bank.ringing[to].passed_to = 1
    place, out = (stretch.at + stretch.i) % BLOCK, transmitted[w, to, stretch.i : stretch.i + stretch.count]
    for k in range(stretch.count):
        x = (place + k) / BLOCK
        ramp = x if phase in (PHASE.rising, PHASE.brief) else (1.0 - x if phase == PHASE.falling else 1.0)
        out[k] += ramp * values[k]


@uncounted
def add_passed(n, bank, scratch):  # pragma: no cover - compiled
    """Add what was transmitted to the bodies' own sound; their rows of scratch.sounds become 1."""
    source, transmitted = scratch.source, scratch.transmitted
    for b in range(len(bank.ringing)):
        if bank.ringing[b].passed_to:
            bank.ringing[b].passed_to, scratch.sounds[b, 0] = 0, 1
            for w in range(len(bank.observed)):
                for k in range(n):
                    value = source[w, b, k] + transmitted[w, b, k]
                    source[w, b, k] = value if abs(value) >= FLUSH else 0.0
                    transmitted[w, b, k] = 0.0


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
