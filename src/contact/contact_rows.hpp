// Contacts of a step in the frames of both bodies of each pair, and their loads in the pairs' histories.
//
//     Contact (k,) -> orient: ContactRow (k,), turned onto the pair's lower body, sorted by pair, as they came within
//     it
//         -> enter_loads: Pair, found by its key or begun anew; the newest load enters, the oldest leaves
//         -> support N at both ends of the step being rendered: the opening of the load       load_splitting.hpp
//
// A pair keeps its place in the table of pairs as long as it touches. The caller makes room first: for the active pairs
// and all that the steps at hand name. No result depends on which place a pair has.
#pragma once

#include "../groups.hpp"
#include "contact_scratch.hpp"

namespace engine {

// Turn the contacts (k,) of a step onto the lower body of each pair: rows (k,), sorted by key, stably.
// quaternion_xyzw (b, 4): of the bodies in that step.
void orient(Array<const Contact, 1> contacts, Array<const double, 2> quaternion_xyzw, Array<ContactRow, 1> rows,
            ContactScratch& memory);

// Enter the loads of rows start … stop - 1, one step's, into the histories, which are shifted by a step.
// Pairs without load in all of their history and without friction (rubs) leave.
void enter_loads(Array<const ContactRow, 1> rows, int64_t start, int64_t stop, double dt_s, const PairTables& pairs,
                 ContactScratch& memory);

}  // namespace engine
