"""How much of the strikes of one physics step has a cause: an approach, or a neighbour that was struck.

STRIKE: approach above what gravity gives a body at rest -> budget, 2·m*·v at most    `set_unheld_steps`, `is_recreated`
    raw impulse, budget -> `accept`: the accepted impulse, the neighbours' handed on
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from sonic_bullet.contact.load_splitting import NOW, SPAN, STEPS
from sonic_bullet.machine.compiled import njit

MOST_HANDED_ON = 8
"""Bodies that an impact travels through in one physics step at most."""


@njit(nogil=True, error_model="numpy")
def set_unheld_steps(ahead, number, pairs, bodies, held):
    """Set held (b,): steps for which gravity may have moved each mobile body although it rests.

    1 where it carried load on any pair within the STEPS before, SPAN where it was just placed: Bullet finds the corners
    of a resting box one a step, and it tilts meanwhile.
    """
    for i in range(len(bodies)):
        held[i] = 0.0
    for i in range(pairs.count[0]):
        pair = pairs.pair[pairs.active[i]]
        for column in range(NOW + ahead - STEPS, NOW + ahead):
            if pair.force_n[column] > 0:
                held[pair.body[0]] = held[pair.body[1]] = 1.0
    for i in range(len(bodies)):
        if bodies[i].mass_kg <= 0:
            held[i] = 0.0
        elif number - bodies[i].placed < SPAN:
            held[i] = SPAN


@njit(nogil=True, error_model="numpy")
def is_recreated(bodies, low, high, approach_m_s, fall_m_s, number):
    """Return whether gravity and the integration repeat a strike of a body at rest; else record it as the last cause.

    fall_m_s: speed that gravity gives along the normal in a step. Bounces of restitution e lose speed at g (1-e)/(2e)
    [a flight 2ve/g long loses (1-e)v]. Half of that is required of them, for solvers give back up to 15 % more than e,
    and gravity of a step as well. A strike that comes sooner than after a flight of that speed, no faster than
    three times the fixed point, and faster than the last cause leaves it by now, has no cause but the steps' length: a
    point that bounces with restitution e on steps of dt stops losing speed at g·dt·e/(1-e); corners of bars, plates and
    boxes do up to 2.8 times as much (Bullet, e 0.3 … 0.8, 1/60 … 1/1000 s).

    A body that leaves at v is back after 2v/g at most: its fastest strike since then is all that is left of that cause.
    Corners of a plate strike many times in a flight, and lose sooner what a ball would keep.
    """
    e = min(bodies[low].rebound * bodies[high].rebound, 1.0)
    limit = 3.0 * max(1.0, e / max(1.0 - e, 1e-9))
    loss_m_s = fall_m_s * (1.0 - e) / (4.0 * max(e, 1e-9))  # a step
    left, recent = 0.0, True
    for body in (low, high):
        one = bodies[body]
        if one.mass_kg > 0:
            if one.since_m_s > 0 and (number - one.cause_step) * fall_m_s >= 2.0 * one.cause_m_s:
                one.cause_m_s, one.cause_step, one.since_m_s = one.since_m_s, one.since_step, 0.0
            left = max(left, one.cause_m_s - loss_m_s * max(number - one.cause_step, 0))
            recent = recent and number - one.loaded <= 2.0 * limit + 2.0
    if recent and left < approach_m_s <= limit * fall_m_s:
        return True
    for body in (low, high):
        one = bodies[body]
        if approach_m_s >= one.cause_m_s - loss_m_s * max(number - one.cause_step, 0):
            one.cause_m_s, one.cause_step, one.since_m_s = approach_m_s, number, 0.0
        elif approach_m_s >= one.since_m_s - loss_m_s * max(number - one.since_step, 0):
            one.since_m_s, one.since_step = approach_m_s, number
    return False


@njit(nogil=True, error_model="numpy")
def accept(strikes, count, bodies, through):
    """Bound strike impulses by their cause: the own budget, or that of a neighbour struck in the same step.

    A body that never moves transmits nothing: the floor. through (b,): scratch. The largest neighbour counts, not the
    sum: solver noise of a pile must not add up to an impact.
    """
    for q in range(count):
        strikes[q].accepted_n_s = min(strikes[q].raw_n_s, strikes[q].budget_n_s)
    grown, rounds = True, 0
    while grown and rounds < MOST_HANDED_ON:
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
