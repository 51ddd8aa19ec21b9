// How much of the strikes of one physics step has a cause: an approach, or a neighbour that was struck.
//
//     Strike: approach above what gravity gives a body at rest -> budget, 2·m*·v at most  set_gravity_steps,
//     is_recreated
//         raw impulse, budget -> accept_strikes: the accepted impulse, the neighbours' transmitted
#pragma once

#include "../groups.hpp"

namespace engine {

constexpr int MOST_TRANSMISSIONS = 8;  // bodies that an impact travels through in one physics step at most

// Set gravity_steps (b,): steps for which gravity may have moved each mobile body although it rests.
//
// 1 where it carried load on any pair within the STEPS before, SPAN where it was just placed: Bullet finds the corners
// of a resting box one a step, and it tilts meanwhile.
void set_gravity_steps(int64_t ahead, int64_t number, const PairTables& pairs, Array<const Body, 1> bodies,
                       Doubles gravity_steps);

// Return whether gravity and the integration repeat a strike of a body at rest; else record it as the last cause.
//
// fall_m_s: speed that gravity gives along the normal in a step. Bounces of restitution e lose speed at g (1-e)/(2e) [a
// flight 2ve/g long loses (1-e)v]. Half of that is required of them, for solvers give back up to 15 % more than e, and
// gravity of a step as well. A strike that comes sooner than after a flight of that speed, no faster than three times
// the fixed point, and faster than the last cause leaves it by now, has no cause but the steps' length: a point that
// bounces with restitution e on steps of dt stops losing speed at g·dt·e/(1-e); corners of bars, plates and boxes do up
// to 2.8 times as much (Bullet, e 0.3 … 0.8, 1/60 … 1/1000 s).
//
// A body that leaves at v is back after 2v/g at most: its fastest strike since then is all that is left of that cause.
// Corners of a plate strike many times in a flight, and lose sooner what a ball would keep.
bool is_recreated(Array<Body, 1> bodies, const int64_t (&pair)[2], double approach_m_s, double fall_m_s,
                  int64_t number);

// Bound strike impulses by their cause: the own budget, or that of a neighbour struck in the same step.
//
// A body that never moves transmits nothing: the floor. The largest neighbour counts, not the sum: solver noise of a
// pile must not add up to an impact. transmitted_n_s (b,): scratch.
void accept_strikes(Array<Strike, 1> strikes, Array<const Body, 1> bodies, Doubles transmitted_n_s);

}  // namespace engine
