"""When the strikes of one physics step come: by gap and approach, with a neighbour that hands them on, or by phase.

STRIKE and its rows -> `date_by_gap`: gap/approach, where surfaces met within the step or the one before
    accepted strikes -> `date_others`: with the neighbour that hands them on; else spread by the body's own phase
    -> `set_starts`: PULSE.start_s, a strike found a step late keeps its phase
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.contact.strike_cause import MOST_HANDED_ON
from sonic_bullet.machine.compiled import njit

EDGE_MARGIN = 0.02
"""Fraction of a step next to its edges to which nothing is spread."""


@njit(nogil=True, error_model="numpy")
def date_by_gap(strike, rows, back_s, dt_s):
    """Date a strike to gap/approach of its first step's row with the largest product of load and approach.

    Only rows count that met within the step or the one before, dt_s and back_s long. A gap of exactly 0 is one that
    nobody knows.
    """
    most, strike.dated, strike.overlaps = 0.0, 0, 0
    for r in range(strike.row[0, 0], strike.row[0, 1]):
        row = rows[r]
        load, speed = row.load_n_s * strike.share[0], row.approach_m_s
        if row.gap_m < 0.0:
            strike.overlaps = 1
        if load * speed > most and row.gap_m != 0.0:
            meets_s = row.gap_m / speed
            if -back_s <= meets_s <= dt_s:
                most, strike.meets_s, strike.dated = load * speed, meets_s, 1


@njit(nogil=True, error_model="numpy")
def date_others(strikes, count, bodies, through, back_s, dt_s):
    """Date the accepted strikes of which gap and approach do not tell the time.

    One that a neighbour hands on comes once the strongest neighbour's has given half of its impulse. Others are spread
    over the step, or over the one before where they overlap as it starts, by their body's phase. through (b,): scratch.
    """
    when_s, grown, rounds = np.empty(len(bodies)), True, 0
    for q in range(count):
        if strikes[q].accepted_n_s > 0 and strikes[q].accepted_n_s <= strikes[q].budget_n_s:
            _spread(strikes[q], bodies, back_s, dt_s)
    while grown and rounds < MOST_HANDED_ON:
        grown, rounds = False, rounds + 1
        for q in range(count):
            through[strikes[q].body[0]] = through[strikes[q].body[1]] = 0.0
        for q in range(count):
            for side in range(2):
                body, one = strikes[q].body[side], strikes[q]
                if one.dated and bodies[body].mass_kg > 0 and one.accepted_n_s > through[body]:
                    through[body], when_s[body] = one.accepted_n_s, one.meets_s + 0.5 * one.length_s
        for q in range(count):
            one = strikes[q]
            body = one.body[0] if through[one.body[0]] >= through[one.body[1]] else one.body[1]
            if not one.dated and one.accepted_n_s > 0 and through[body] > 0:
                one.meets_s, one.dated, grown = when_s[body], 1, True
    for q in range(count):
        if strikes[q].accepted_n_s > 0:
            _spread(strikes[q], bodies, back_s, dt_s)


@njit(nogil=True, error_model="numpy")
def _spread(strike, bodies, back_s, dt_s):
    """Date a strike that is not dated by the phase of its lower body that moves."""
    if not strike.dated:
        body = bodies[strike.body[0] if bodies[strike.body[0]].mass_kg > 0 else strike.body[1]]
        phase = phase_in_step(body.surface_seed, body.spread)
        strike.meets_s = (phase - 1.0) * back_s if strike.overlaps else phase * dt_s
        strike.dated = 1
        body.spread += 1


@njit(nogil=True, error_model="numpy")
def set_starts(strikes, count, pulses, ahead, back_s, dt_s):
    """Set the starts of the strikes' pulses within the step; one that is found a step late keeps its phase."""
    for q in range(count):
        if strikes[q].pulse >= 0:
            pulse, meets_s = pulses[strikes[q].pulse], strikes[q].meets_s
            late_s = 0.0 if ahead or meets_s >= 0.0 else back_s
            pulse.start_s, pulse.ahead = min(meets_s + late_s, dt_s), ahead


@njit(nogil=True, error_model="numpy")
def phase_in_step(seed: int, count: int) -> float:
    """Compute the fraction of a step at which a body's count-th undated impact acts: EDGE_MARGIN … 1 - EDGE_MARGIN.

    Multiples of the golden ratio from a start of the body's own: of all such sequences the most even, however many
    impacts there are [Knuth, The Art of Computer Programming 3, 1998, sec. 6.4, theorem S]. seed: 32 bits.
    """
    golden_section = 0.6180339887498949
    phase = seed / 4294967296.0 + golden_section * count
    return EDGE_MARGIN + (1.0 - 2.0 * EDGE_MARGIN) * (phase - int(phase))
