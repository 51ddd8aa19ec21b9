// Poses and twists at the start of a step, and which bodies were moved by hand.
//
// A semi-implicit integrator has x(n+1) = x(n) + v(n+1)·dt, so a pose that jumps farther than its speeds allow was
// moved by hand. A body of mass 0 may be driven by resetting its pose each step: up to 10 m/s that is motion, and the
// body has the velocity of that move; above it, it is a jump.
#pragma once

#include "listener_tables.hpp"

namespace engine {

// Fill start (n,) for a step of length dt_s; return how many links were moved by hand.
//     earlier, later (n,)   with hooks, read before the step before and before this one; else after those
//     moved_bodies (h,)     ids of bodies known to be moved
// The roster is unchanged, so no body is new.
int64_t begin_step(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later, double dt_s,
                   Array<const int64_t, 1> moved_bodies, bool hooked, Array<LinkStart, 1> start);

// Tell whether every number of two tables is the same.
bool is_unmoved(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later);

}  // namespace engine
