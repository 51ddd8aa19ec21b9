"""Tables of the bank and the numbers that its kernels share: one row a body or strike, each in a fixed place.

    BANK_BODY   a body: its lanes in the flat arrays, and the pole that its three translations share
    RINGING     its activity: flags, the translations' state, the first of its strikes
    BANK_STRIKE a pulse under way: a pool of rows, those of a body linked in order of start, then of arrival

Modes of all bodies lie in flat arrays, a body's `columns` (audible modes, then the lines of its residual) in whole
groups of LANE_PAIR lanes; spare lanes are zero. m lanes of all bodies:
    law (6, m): decay and turn a sample (s = -d/sr + iω/sr), d/ω, bend, damping growth and its power
    z, driven, pole, block (2·m): real parts first. z: free state at the next block's start; driven: what was driven
    since this block's; pole = e^s, block = e^{256 s}, both bent by level where a body is
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.machine.vector import LANES
from sonic_bullet.records import Array

LANE_PAIR = 2 * LANES
"""Lanes that are driven side by side: two vectors hide the latency of each other's multiply-adds."""
DRIVEN = 32
"""Samples, on the grid of absolute time, that are driven at a time; driven modes keep their bent poles as long."""
ROOM = DRIVEN + LANES
"""Samples of room for pushes: whole tiles are computed, and those past the end are not used."""
COLUMNS = 64
"""Lanes of a body that are driven at a time: their pushes stay in the first cache."""
MOST_DUE = 128
"""Nodes of one strike in DRIVEN samples, at most: 24 in all, or two a sample and a few."""

FLOOR = 1e-15
"""Modes with |z| below this (in √J·√2) are set to zero: ½|z|² = 5e-31 J is 1e-10 of the mode's thermal energy kT at
300 K.
"""
FLUSH = 1e-30
"""Output samples below this become 0: they have no meaning in pascal or m/s, and their float32 would be subnormal.
Gains and forces below it, too: no product of theirs becomes subnormal."""

BANK_BODY = np.dtype(
    [
        ("start", "i8"),  # lanes in the flat arrays
        ("stop", "i8"),
        ("columns", "i8"),  # of those, in use
        ("bent", "i8"),  # 1: its poles depend on its level
        ("rigid", "i8"),  # 1: its translations are active
        ("rigid_log_pole", "f8", (2,)),  # s of the translations
        ("rigid_pole", "f8", (2,)),
        ("rigid_onset", "f8", (2,)),  # (1 + i d/ω)(e^s - 1)/s: of a force that acts evenly over the sample before
        ("rigid_quadrature", "f8"),  # d/ω
        ("rigid_weight", "f8"),  # Pa·m per N·s
    ],
    align=True,
)

RINGING = np.dtype(
    [
        ("ringing", "i8"),  # 1: z is not zero
        ("driven", "i8"),  # 1: driven is not zero
        ("tiled", "i8"),  # 1: the block's free sound is not zero
        ("moving", "i8"),  # 1: a translation's state is not zero
        ("fresh", "i8"),  # 1: other poles at the next block's start
        ("transmissions", "i8"),  # that are not off
        ("passed_to", "i8"),  # 1: within a call, a body transmitted to it
        ("strike", "i8"),  # slot of its first strike, -1 for none
        ("motion", "f8", (3, 2)),  # state of the translations
    ],
    align=True,
)

BANK_STRIKE = np.dtype(
    [
        ("start", "f8"),  # absolute time of the pulse, in samples
        ("length", "f8"),  # in samples
        ("flat", "i8"),  # half-sine, not Hertz'
        ("next", "i8"),  # slot of the body's next strike, -1 for none
        ("modal", "i8"),  # 1 while nodes are to come
        ("count", "i8"),  # nodes
        ("force_sum", "f8"),  # of the pulse at all of them
        ("ahead", "f8"),  # how far after the edge of its first cell it starts
        ("spacing", "f8"),  # δ in samples
        ("whole", "i8"),  # 1/δ
        ("first", "i8"),  # sample at or after the first node
        ("within", "i8"),  # nodes up to it
        ("upcoming", "i8"),  # next node
        ("phase", "f8"),  # of the sample before, after the last node
        ("rigid", "i8"),  # 1 while cells are to come
        ("cells", "i8"),  # a sample
        ("cell_first", "i8"),
        ("cell_stop", "i8"),
        ("cell_turn", "f8", (2,)),  # e^{s/cells} of the translations
        ("cell_onset", "f8", (2,)),  # response to a cell's impulse at the cell's end
        ("rigid_impulse_n_s", "f8", (3,)),
    ],
    align=True,
)


class BankTables(NamedTuple):
    """Bank and its state: fields of `instrument.Bank` (body … hertz) and of `instrument.BankState`."""

    body: Array
    weight: Array
    observed: Array
    hertz: Array
    aims: Array
    ringing: Array
    law: Array
    z: Array
    driven: Array
    sound: Array
    pole: Array
    block: Array
    coming: Array
    transmissions: Array
    transmission_weight: Array
    transmission_sound: Array
    aim: Array
    turned: Array
    blend: Array
    strikes: Array
    rows: Array
    free: Array


class ScratchTables(NamedTuple):
    """Tables of one step: pulses and drives in, sound out; see `runtime.synthesis_state.StepScratch`."""

    count: Array  # type: ignore[assignment]
    pulse: Array
    modal_impulse: Array
    force: Array
    gain0: Array
    gain1: Array
    direction0: Array
    direction1: Array
    body: Array
    slot: Array
    source: Array
    transmitted: Array
    dipole: Array
    sounds: Array


class BankWork(NamedTuple):
    """Scratch of one call of the bank, for d drives and n samples.

    first (b + 1,), side (2·d,): forces by body; signal (d, 2, n + LANES): their impulses at both ends of the gains;
    axis_impulse (6, n + LANES): of a translation; plan (DRIVEN, 3): of a strike; flat: DRIVE_SCRATCH or RING_SCRATCH
    numbers.
    """

    first: Array
    side: Array
    signal: Array
    axis_impulse: Array
    plan: Array
    flat: Array


class Stretch(NamedTuple):
    """Samples i … i + count - 1 of a call that begins at sample ``at``, within one of the DRIVEN or one block."""

    at: int
    i: int | np.int64
    count: int | np.int64  # type: ignore[assignment]


class Lanes(NamedTuple):
    """Lanes start … start + count - 1 of arrays with ``modes`` real parts, then as many imaginary ones."""

    modes: int
    start: int
    count: int  # type: ignore[assignment]
