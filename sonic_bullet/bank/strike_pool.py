"""Strikes under way: a pool of rows, each a force pulse on one body until the last of it has acted.

    modes: nodes u_j = u_0 + jδ, impulses J_j = F(u_j)/Σ F:   at each sample n the driven state gains
        r_n Σ J_j D^(last - j)   over the nodes in (n-1, n]
        D = e^{sδ},   r_n = g (1 + i d/ω) e^{s(n - u_last)},   r_{n+1} = r_n e^{s(1 - kδ)},
            k = nodes in (n, n+1] = 1/δ
        the middles of cells of the sample grid: at a sample all of the pulse has acted that is over, and no more, so
        that what is slow moves a fast mode by its slope alone:   Σ_k e^{iωδ(k + 1/2)} = i/(2 sin(ωδ/2)),   no real part
    so each mode needs four phasors (r, D and the two turns of r), computed once, and no exponential at run time
    translations: `translation`

Impulses are evaluated as they fall due, from the pulse's own shape; only their sum is known before. Times in samples, s
per sample. A body's strikes are linked in order of their start, then of arrival: which ends first changes no sum.
free: how many rows of the pool are free, then their numbers.
"""

# mypy: disable-error-code="no-untyped-def"
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sonic_bullet.bank.kernels import uncounted
from sonic_bullet.bank.layout import FLUSH, Lanes
from sonic_bullet.bank.phasors import fill_phasors
from sonic_bullet.machine.vector import At
from sonic_bullet.records import Array

NODES_PER_PULSE = 24
NODES_PER_SAMPLE = 2
SHORTEST_PULSE = 1e-12
"""Shortest length of a pulse, in samples; shorter ones get it."""


class BodyPulse(NamedTuple):
    """One pulse on one body.

    Attributes
    ----------
    start : absolute, in samples
    length : in samples
    flat : 1 for a half-sine, 0 for Hertz'
    share : factor of gain and impulse
    gain : (columns,) φᵀĵ of the body's modes in N·s/√kg, whole groups of PAIR lanes (spare ones finite)
    impulse_n_s : three numbers, world
    """

    start: float
    length: float
    flat: int
    share: float
    gain: Array
    impulse_n_s: tuple[float, float, float]


@uncounted
def pulse_force(share, flat, hertz):  # pragma: no cover - compiled
    """Interpolate the force at a fraction of the pulse, mean 1, and 0 outside [0, 1]. hertz: table of `pulse_shape`."""
    if not 0.0 <= share <= 1.0:
        return 0.0
    if flat:
        return 0.5 * np.pi * np.sin(np.pi * share)
    cells = hertz.shape[1] - 1
    place = share * cells
    i = min(int(place), cells - 1)
    return hertz[1, i] + (place - i) * (hertz[1, i + 1] - hertz[1, i])


@uncounted
def enter_strike(b, pulse, at, bank):  # pragma: no cover - compiled
    """Enter a `BodyPulse` on body b: 0, or 1 where the pool is full (nothing has changed then).

    It starts at or after sample ``at``.
    """
    strikes, free, share = bank.strikes, bank.free, pulse.share
    modal, rigid = False, False
    for k in range(bank.body[b].columns):
        modal = modal or abs(pulse.gain[k] * share) >= FLUSH
    if bank.body[b].rigid:
        rigid = pulse.impulse_n_s[0] != 0.0 or pulse.impulse_n_s[1] != 0.0 or pulse.impulse_n_s[2] != 0.0
    if not (modal or rigid):
        return 0
    if free[0] == 0:
        return 1
    slot = free[free[0]]
    free[0] -= 1
    length = max(pulse.length, SHORTEST_PULSE)
    strikes[slot].start = pulse.start
    strikes[slot].length = length
    strikes[slot].flat = pulse.flat
    strikes[slot].modal = 1 if modal else 0
    strikes[slot].rigid = 1 if rigid else 0
    if modal:
        _enter_nodes(slot, b, at, pulse, bank)
    if rigid:
        _enter_cells(slot, b, bank)
        for axis in range(3):
            strikes[slot].rigid_impulse_n_s[axis] = share * pulse.impulse_n_s[axis]
    _link(slot, b, bank)
    return 0


@uncounted
def _enter_nodes(slot, b, at, pulse, bank):  # pragma: no cover - compiled
    """Divide the pulse into cells of the sample grid, with a node in the middle of each."""
    at_once = 1e-3  # Samples: a shorter pulse acts whole at the first sample that any of it has come to
    strike = bank.strikes[slot]
    if strike.length > at_once:
        whole = max(NODES_PER_SAMPLE, int(np.ceil(NODES_PER_PULSE / strike.length)))
        begin = int(np.floor(strike.start * whole))
        count = int(np.ceil((strike.start + strike.length) * whole)) - begin
        delta, edge = 1.0 / whole, begin / whole
        first = max(int(np.ceil(edge + 0.5 * delta)), at)
        within = min(first * whole - begin, count) - 1
    else:
        count, edge = NODES_PER_PULSE, strike.start
        delta = strike.length / count
        whole, within = int(np.floor(1.0 / delta)), count - 1
        first = max(int(np.ceil(edge + 0.5 * delta)), at)
    strike.ahead, total = strike.start - edge, 0.0
    for i in range(count):
        total += pulse_force(((i + 0.5) * delta - strike.ahead) / strike.length, strike.flat, bank.hertz)
    phase = max((first - (edge + 0.5 * delta)) - within * delta, 0.0)
    strike.count, strike.spacing, strike.whole, strike.force_sum = count, delta, whole, total
    strike.first, strike.within, strike.upcoming, strike.phase = first, within + 1, 0, phase
    width = bank.rows.shape[2]
    lanes = Lanes(bank.law.shape[1], bank.body[b].start, bank.body[b].stop - bank.body[b].start)
    times = phase, delta, 1.0 - whole * delta, 1.0 - (whole + 1) * delta
    fill_phasors(At(bank.rows, slot * 8 * width), width, bank.law, lanes, pulse.gain, pulse.share, times)


@uncounted
def _enter_cells(slot, b, bank):  # pragma: no cover - compiled
    """Divide the pulse into cells of the sample grid, which no sample cuts through, and compute a cell's response.

    (1 + i d/ω) (e^{s/cells} - 1)/(s/cells): an impulse that acts evenly over the cell, at the cell's end.
    """
    # cells of a pulse per 1/w of a rigid body: a third of (w·cell)³ = 0.5 % is the error allowed in its level
    cells_per_radian = 4.0
    most_cells = 4096  # Cells a sample: a pulse shorter than one is even over it
    strike, body = bank.strikes[slot], bank.body[b]
    s = complex(body.rigid_log_pole[0], body.rigid_log_pole[1])
    least = int(np.ceil(cells_per_radian * -s.real))
    cells = max(least, int(np.ceil(min(NODES_PER_PULSE / strike.length, 1.0 * most_cells))))
    strike.cells = cells
    strike.cell_first = int(np.floor(strike.start * cells))
    strike.cell_stop = int(np.ceil((strike.start + strike.length) * cells))
    x, y = s.real / cells, s.imag / cells
    less = complex(np.expm1(x) * np.cos(y) - 2.0 * np.sin(0.5 * y) ** 2, np.exp(x) * np.sin(y))
    onset = complex(1.0, body.rigid_quadrature) * less / complex(x, y)
    strike.cell_turn[0], strike.cell_turn[1] = 1.0 + less.real, less.imag
    strike.cell_onset[0], strike.cell_onset[1] = onset.real, onset.imag


@uncounted
def _link(slot, b, bank):  # pragma: no cover - compiled
    """Put a strike behind those of its body that start before it or with it."""
    ringing, strikes = bank.ringing, bank.strikes
    before, after = -1, ringing[b].strike
    while after >= 0 and strikes[after].start <= strikes[slot].start:
        before, after = after, strikes[after].next
    strikes[slot].next = after
    if before < 0:
        ringing[b].strike = slot
    else:
        strikes[before].next = slot


@uncounted
def release_done(b, bank):  # pragma: no cover - compiled
    """Free the rows of body b's strikes that have acted."""
    ringing, strikes, free = bank.ringing, bank.strikes, bank.free
    before, slot = -1, ringing[b].strike
    while slot >= 0:
        after = strikes[slot].next
        if strikes[slot].modal or strikes[slot].rigid:
            before = slot
        else:
            if before < 0:
                ringing[b].strike = after
            else:
                strikes[before].next = after
            free[0] += 1
            free[free[0]] = slot
        slot = after


@uncounted
def begins(b, end, bank):  # pragma: no cover - compiled
    """Return whether a strike on the modes of body b has nodes to come before sample ``end``."""
    slot = bank.ringing[b].strike
    while slot >= 0:
        if bank.strikes[slot].modal and bank.strikes[slot].first < end:
            return True
        slot = bank.strikes[slot].next
    return False


@uncounted
def plan_nodes(slot, at, count, bank, plan, due, final):  # pragma: no cover - compiled
    """Plan which nodes of a strike act at the samples at … at + count - 1.

    Fills plan (count, 3): 0 for E0, 1 for E1, -1 for none; nodes; and how many of their places are empty behind the
    last; and due: impulses, node after node. Returns the samples they begin and end with.
    final: the strike advances.
    """
    strike = bank.strikes[slot]
    upcoming, phase, filled = strike.upcoming, strike.phase, 0
    begin = max(strike.first - at, 0)
    k = begin
    while k < count and upcoming < strike.count:
        if at + k == strike.first:
            nodes = strike.within
            plan[k, 0] = -1
        else:
            nodes = min(max(int(np.floor((phase + 1.0) / strike.spacing)), strike.whole), strike.whole + 1)
            phase += 1.0 - nodes * strike.spacing
            plan[k, 0] = nodes - strike.whole
        real = min(nodes, strike.count - upcoming)
        plan[k, 1], plan[k, 2] = real, nodes - real
        for i in range(upcoming, upcoming + real):
            share = ((i + 0.5) * strike.spacing - strike.ahead) / strike.length
            due[filled] = pulse_force(share, strike.flat, bank.hertz) / strike.force_sum
            filled += 1
        upcoming += real
        k += 1
    if final:
        strike.upcoming, strike.phase = upcoming, phase
        strike.modal = 1 if upcoming < strike.count else 0
    return begin, k


@uncounted
def enter_pulses(begin_s, after_s, at, sr, bank, scratch):  # pragma: no cover - compiled
    """Enter a step's pulses on both bodies of each, in order; return how many, fewer where the pool is full.

    They stand in scratch: pulse, PULSE rows of runtime.tables, and modal_impulse (pulses, 2, columns), Uᵀj of the
    whole impulse. begin_s, after_s: of the rendered step, absolute: those found in the step after it count from there.
    at: the next sample.
    """
    count = scratch.count[0]
    for i in range(count):
        if bank.free[0] < 2:
            return i
        pulse = scratch.pulse[i]
        begin = after_s if pulse.ahead else begin_s
        start = max((begin + pulse.start_s) * sr, float(at))
        for side in range(2):
            sign, j = 1.0 - 2.0 * side, pulse.impulse_n_s
            impulse = sign * j[0], sign * j[1], sign * j[2]
            one = BodyPulse(
                start, pulse.length_s * sr, pulse.flat, pulse.share, scratch.modal_impulse[i, side], impulse
            )
            enter_strike(pulse.body[side], one, at, bank)
    return count
