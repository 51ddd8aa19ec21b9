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
(`phase_in_step`).

The loads themselves are split in `contact.strike_pulses`, on the tables of pairs.
"""

from __future__ import annotations

from sonic_bullet.machine.compiled import njit

SPAN = 4
NOW = SPAN - 1
"""Column of a load history that is the step being rendered; later ones are the look-ahead."""
LOOKAHEAD = SPAN - 1
HISTORY = 2 * SPAN - 1
"""Steps of load that are stored for a pair; column SPAN - 1 is the step being rendered."""
GOLDEN_SECTION = 0.6180339887498949
EDGE_MARGIN = 0.02
"""Fraction of a step next to its edges to which nothing is spread."""


@njit(nogil=True, error_model="numpy")
def phase_in_step(seed: int, count: int) -> float:
    """Compute the fraction of a step at which a body's count-th undated impact acts: EDGE_MARGIN … 1 - EDGE_MARGIN.

    Multiples of the golden ratio from a start of the body's own: of all such sequences the most even, however many
    impacts there are [Knuth, The Art of Computer Programming 3, 1998, sec. 6.4, theorem S]. seed: 32 bits.
    """
    phase = seed / 4294967296.0 + GOLDEN_SECTION * count
    return EDGE_MARGIN + (1.0 - 2.0 * EDGE_MARGIN) * (phase - int(phase))
