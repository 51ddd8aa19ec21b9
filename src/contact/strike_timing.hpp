// When the strikes of one physics step come: by gap and approach, with a neighbour that transmits them, or by phase.
//
//     Strike and its rows -> date_by_gap: gap/approach, where surfaces met within the step or the one before
//         accepted strikes -> date_others: with the neighbour that transmits them; else spread by the body's own phase
//         -> set_starts: Pulse.start_s, a strike found a step late keeps its phase
#pragma once

#include "../groups.hpp"
#include "contact_scratch.hpp"

namespace engine {

constexpr double EDGE_MARGIN = 0.02;  // fraction of a step next to its edges to which nothing is spread

// Date a strike to gap/approach of its first step's row with the largest product of load and approach.
//
// Only rows count that met within the step or the one before, dt_s and back_s long. A gap of exactly 0 is one that
// nobody knows.
void date_by_gap(Strike& strike, Array<const ContactRow, 1> rows, double back_s, double dt_s);

// Date the accepted strikes of which gap and approach do not tell the time.
//
// One that a neighbour transmits comes once the strongest neighbour's has given half of its impulse. Others are spread
// over the step, or over the one before where they overlap as it starts, by their body's phase.
void date_others(Array<Strike, 1> strikes, Array<Body, 1> bodies, double back_s, double dt_s, ContactScratch& memory);

// Set the starts of the strikes' pulses within the step; one that is found a step late keeps its phase.
void set_starts(Array<const Strike, 1> strikes, Array<Pulse, 1> pulses, int64_t ahead, double back_s, double dt_s);

// Compute the fraction of a step at which a body's count-th undated impact acts: EDGE_MARGIN … 1 - EDGE_MARGIN.
//
// Multiples of the golden ratio from a start of the body's own: of all such sequences the most even, however many
// impacts there are [Knuth, The Art of Computer Programming 3, 1998, sec. 6.4, theorem S]. seed: 32 bits.
double phase_in_step(int64_t seed, int64_t count);

}  // namespace engine
