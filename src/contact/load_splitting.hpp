// Split of the loads of touching pairs into support, strikes and friction.
//
//     impulses of each step -> load F (pairs, steps) -> support N = opening of F
//         -> strike = top-hat F - N over a rising edge
//
// A physics step gives only the mean force over it. Applied to a mode as it is, a resting weight would be a comb at the
// step rate [van den Doel, Kry, Pai 2001, sec. 5 discuss the same of recorded forces]. The split is a morphological
// opening of the load over SPAN steps [Serra 1982, ch. II]. What lasts that long carries weight and is silent (it loads
// the surface model instead), what is shorter is an impact. Impacts of up to SPAN - 1 steps become one strike:
// simulators spread one impact over 2-3 steps.
//
// An impact needs a cause. A solver's flicker between the corners of a resting box looks like an impact, but nothing
// approached. So a pair's strike is bounded by 2·m*·v (an elastic impact at the approach speed v before the step), or
// by what a struck neighbour transmits. Where a mobile body of the pair carried load within the last SPAN - 1 steps, v
// counts above the speed that gravity gives along the normal in one step: below it, leaving and landing cannot be
// distinguished from resting, nor a roll from one support on to the next from a fall.
//
// Surfaces that overlap when a step starts have met in the step before (with `contactProcessingThreshold=0`, Bullet
// sees a contact only then): strikes are looked for one step ahead of the step being rendered, so that they can be
// dated back. What cannot be distinguished from support that early (the last step of an impact of SPAN - 1 steps is the
// last one known) follows when the step itself is rendered, a step late.
//
// All impacts of a step have its time stamp; sounded there they would be a comb at the step rate. When surfaces met,
// gap and approach tell; a neighbour that transmits an impact tells; where nothing does, impacts are spread over the
// step (strike_timing).
#pragma once

#include "../groups.hpp"

namespace engine {

constexpr int SPAN = 4;
constexpr int NOW = SPAN - 1;        // column of a load history that is the step being rendered; later ones are ahead
constexpr int LOOKAHEAD = SPAN - 1;  // steps that are known beyond the one being rendered
constexpr int STEPS = SPAN - 1;      // that one strike takes at most
static_assert(HISTORY == 2 * SPAN - 1);

// Compute the opening of the load at a column of its history: the best of the windows of SPAN steps around it, which
// are cut where the future is not known.
double opening(const double (&force_n)[HISTORY], int column);

// Find the strikes in the loads of step `number`, `ahead` after the one being rendered; mark the loads as used.
//
// Returns the number of strikes; their bodies, fractions and rows are set. An opening that the future could still lower
// is taken as high as it may be, so that support is never struck; a later call gives a strike what it lacked.
int64_t split_loads(int64_t ahead, int64_t number, const WindowTables& window, const PairTables& pairs,
                    Array<Strike, 1> strikes);

}  // namespace engine
