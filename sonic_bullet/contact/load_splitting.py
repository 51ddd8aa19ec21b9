"""Split of the loads of touching pairs into support, strikes and friction.

    impulses of each step -> load F (pairs, steps) -> support N = opening of F -> strike = top-hat F - N over a rising
        edge

A physics step gives only the mean force over it. Applied to a mode as it is, a resting weight would be a comb at the
step rate [van den Doel, Kry, Pai 2001, sec. 5 discuss the same of recorded forces]. The split is a morphological
opening of the load over `SPAN` steps [Serra 1982, ch. II]. What lasts that long carries weight and is silent (it loads
the surface model instead), what is shorter is an impact. Impacts of up to SPAN - 1 steps become one strike: simulators
spread one impact over 2-3 steps.

An impact needs a cause. A solver's flicker between the corners of a resting box looks like an impact, but nothing
approached. So a pair's strike is bounded by 2·m*·v (an elastic impact at the approach speed v before the step), or by
what a struck neighbour transmits. Where a mobile body of the pair carried load within the last SPAN - 1 steps, v counts
above the speed that gravity gives along the normal in one step: below it, leaving and landing cannot be distinguished
from resting, nor a roll from one support on to the next from a fall.

Surfaces that overlap when a step starts have met in the step before (with `contactProcessingThreshold=0`, Bullet sees a
contact only then): strikes are looked for one step ahead of the step being rendered, so that they can be dated back.
What cannot be distinguished from support that early (the last step of an impact of SPAN - 1 steps is the last one
known) follows when the step itself is rendered, a step late.

All impacts of a step share its time stamp; sounded there they would be a comb at the step rate. Surfaces met when gap
and approach say; a neighbour that hands an impact on says when; where nothing does, impacts are spread over the step
(`strike_timing`).
"""
# mypy: disable-error-code="no-untyped-def"

from __future__ import annotations

from sonic_bullet.machine.compiled import njit

SPAN = 4
NOW = SPAN - 1
"""Column of a load history that is the step being rendered; later ones are the look-ahead."""
LOOKAHEAD = SPAN - 1
HISTORY = 2 * SPAN - 1
"""Steps of load that are stored for a pair; column SPAN - 1 is the step being rendered."""
STEPS = SPAN - 1
"""Steps that one strike takes at most."""


@njit(nogil=True, error_model="numpy")
def opening(force, column):
    """Compute the opening of the load at a column: the best of the windows of SPAN steps around it.

    Windows are cut where the future is not known.
    """
    best = 0.0
    if force[column] > 0:
        for first in range(max(column - SPAN + 1, 0), column + 1):
            least = force[first]
            for i in range(first + 1, min(first + SPAN, HISTORY)):
                least = min(least, force[i])
            best = max(best, least)
    return best


@njit(nogil=True, error_model="numpy")
def split_loads(ahead, number, window, pairs, strikes):
    """Find the strikes in the loads of step ``number``, ``ahead`` after the one being rendered; mark them as used.

    Returns the number of strikes; their bodies, fractions and rows are set. An opening that the future could still
    lower is taken as high as it may be, so that support is never struck; a later call gives a strike what it lacked.
    """
    found, rows = 0, window.row
    for i in range(pairs.count[0]):
        pair, column = pairs.pair[pairs.active[i]], NOW + ahead
        force = pair.force_n
        if not force[column] > force[column - 1]:
            continue
        strike = strikes[found]
        for j in range(STEPS):
            strike.share[j] = 0.0
        for j in range(STEPS):
            load = force[column + j]
            excess = load - opening(force, column + j) - pair.struck_n[column + j]
            if not excess > 1e-9 * load:  # rounding of the sums is no impact
                break
            pair.struck_n[column + j] += excess
            strike.share[j] = excess / load
            first, last = window.step[(number + j) % SPAN].row
            stop = last
            while first < stop:  # its first row: they are sorted
                middle = (first + stop) // 2
                if rows[middle].key < pair.key:
                    first = middle + 1
                else:
                    stop = middle
            while stop < last and rows[stop].key == pair.key:
                stop += 1
            strike.row[j, 0], strike.row[j, 1] = first, stop
        if strike.share[0] > 0:
            strike.body[0], strike.body[1] = pair.body[0], pair.body[1]
            found += 1
    return found
