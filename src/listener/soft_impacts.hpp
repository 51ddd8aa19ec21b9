// Impacts of soft contacts, which brake a body over many steps, collected to one strike.
//
//     rows of a step -> a pair that meets faster than gravity explains: pass the load before, or the weight of the
//                       lighter body, as its support; hold the rest
//                    -> it parts, its load or its speed has settled: one row a contact point, all that was held
//     all other rows pass as they are
//
// A soft constraint spreads an impact over its time constant, 10 ms and more, where real ones last microseconds. Taken
// step by step it would be a support (contact.load_splitting). No impulse is lost or made: what is held is given out
// later, so that the sums balance momentum over each impact. The strike comes as the impact ends.
//
// The load has settled: what exceeds the support is below 3 % of its peak. The speed has: it is below 5 % of the first
// and, at its present rate, would not have changed by more than twice that since the impact began; at the turning point
// of an elastic impact, where the speed is 0 as well, that is π/2 of it.
#pragma once

#include "listener_tables.hpp"

namespace engine {

constexpr double LONGEST_IMPACT_S = 0.1;  // what brakes a body for longer is a cushion, which is silent

// Tables of one step: impacts and points held, pairs of the step before and of this one, rows that it gives out.
struct ImpactTables {
    Array<SoftImpact, 1> impact;
    Array<HeldPoint, 1> held;
    Array<PairLoad, 1> before;
    Array<PairLoad, 1> now;
    Array<Contact, 1> out;
    Integers counts;  // of impacts, held, now, out
};
GROUP_FIELDS(ImpactTables, impact, held, before, now, out, counts)

// Fill out; update impact, held, now and counts. weight_n (k,): of the lighter body of each row (k,). fall_m_s: closing
// speed that begins no impact.
void collect_rows(Array<const Contact, 1> row, Array<const double, 1> weight_n, double dt_s, double fall_m_s,
                  const ImpactTables& tables);

}  // namespace engine
