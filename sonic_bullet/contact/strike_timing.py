"""How much of the strikes of one physics step has a cause, and when each comes: their own, or their neighbours'.

STRIKE: raw impulse, budget -> `accept`: what of it has a cause
    time by gap and approach, where they tell -> `date_strikes`: the rest with the neighbour that hands them on, or
    spread by the body's phase
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

import numpy as np

from sonic_bullet.contact.load_splitting import phase_in_step
from sonic_bullet.machine.compiled import njit

ROUNDS = 8
"""Bodies that an impact travels through in one physics step at most."""


@njit(nogil=True, error_model="numpy")
def accept(strikes, count, bodies, through):
    """Bound strike impulses by their cause: the own budget, or that of a neighbour struck in the same step.

    A body that never moves transmits nothing: the floor. through (b,): scratch. The largest neighbour counts, not the
    sum: solver noise of a pile must not add up to an impact.
    """
    for q in range(count):
        strikes[q].accepted_n_s = min(strikes[q].raw_n_s, strikes[q].budget_n_s)
    grown, rounds = True, 0
    while grown and rounds < ROUNDS:
        for q in range(count):
            for side in range(2):
                through[strikes[q].body[side]] = 0.0
        for q in range(count):
            for side in range(2):
                body = strikes[q].body[side]
                if bodies[body].mass_kg > 0:
                    through[body] = max(through[body], strikes[q].accepted_n_s)
        grown = False
        for q in range(count):
            strike = strikes[q]
            handed = max(through[strike.body[0]], through[strike.body[1]])
            more = min(strike.raw_n_s, max(strike.budget_n_s, handed))
            grown = grown or more != strike.accepted_n_s
            strike.accepted_n_s = more
        rounds += 1


@njit(nogil=True, error_model="numpy")
def date_strikes(strikes, count, bodies, through, back_s, dt_s):
    """Date the accepted strikes of which gap and approach do not tell the time.

    One that a neighbour hands on comes once the strongest neighbour's has given half of its impulse. Others are spread
    over the step, or over the one before where they overlap as it starts, by their body's phase. through (b,): scratch.
    """
    when_s, grown, rounds = np.empty(len(bodies)), True, 0
    for q in range(count):
        if strikes[q].accepted_n_s > 0 and strikes[q].accepted_n_s <= strikes[q].budget_n_s:
            _spread(strikes[q], bodies, back_s, dt_s)
    while grown and rounds < ROUNDS:
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
