// Contacts as PyBullet reports them -> loaded contacts.
//
//     J = dt · (N n + f1 t1 + f2 t2)      on body A, world frame; −J on body B
//
// with dt the time step set at the moment of the query: that product, and no other, balances m·Δv − m·g·dt (measured to
// 1e-13). Only the unfiltered getContactPoints() is right: with a body filter that swaps the pair, normal and positions
// are inverted and the friction fields are not (bullet3 issues 2765, 3026).
#pragma once

#include "listener_tables.hpp"

namespace engine {

// Fill loaded (k,) from reported (k,) and return how many are filled; numbers are not checked. before: those reported
// after the step before. A contact farther off than its contactProcessingThreshold is not solved. It keeps the friction
// of the step in which it last was, to the bit, with no normal force: that friction does not act. Friction without
// normal force that is new does act: the solver ended between the two, and without it momentum does not balance.
int64_t load_contacts(Array<const ReportedContact, 1> reported, Array<const ReportedContact, 1> before, double dt_s,
                      Array<LoadedContact, 1> loaded);

// Tell whether all numbers of the first count contacts are within INVALID_BEYOND and none is NaN.
bool are_usable(Array<const LoadedContact, 1> loaded, int64_t count);

}  // namespace engine
