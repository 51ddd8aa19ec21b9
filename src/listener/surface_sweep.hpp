// Speed of a contact over either surface.
//
//     u_b − u_a = v_a − v_b = slip                 u: velocity of the contact relative to a body's material (exact)
//     u_a ≈ ½ (d_a + d_b − slip), u_b = u_a + slip
//
// d_a, d_b: displacement of the contact in either body's frame since the same contact was last seen, over the time
// between [the frames of Montana 1988, The kinematics of contact and grasp, eq. 20-24, by differences instead of
// curvatures]. PyBullet does not identify contacts from step to step, and a resting box shows one to four of its
// corners at a time, in turn. A contact is therefore matched to the nearest earlier one of its pair among the last
// MEMORY_STEPS steps. Without slip a contact travels no faster than |ω_rel|·R: a match is refused if it moves faster
// than that over both surfaces at once. Without a match the pair keeps its last velocity; a new pair's contact stays on
// the smaller body.
#pragma once

#include "listener_tables.hpp"

namespace engine {

// Contacts of the last MEMORY_STEPS steps, in a ring of one table more.
struct TraceTables {
    Array<ContactTrace, 2> table;  // (MEMORY_STEPS + 1, capacity)
    Integers count;                // contacts of each table
    int64_t newest;                // table of the coming step
    Array<int64_t, 2> sorting;     // (3, capacity): scratch
};
GROUP_FIELDS(TraceTables, table, count, newest, sorting)

// Give the speeds in m/s of a contact over links a and b, and its trace, whose time is set. slip_m_s: of a over b.
// pair: its key, a first.
void sweep_surfaces(const LoadedContact& contact, const LinkStart& a, const LinkStart& b, int64_t pair,
                    const double slip_m_s[3], const TraceTables& traces, ContactTrace& fresh, double speed_m_s[2]);

// Write pair and order of the first count traces: contact rows by (a, b), stable. sorting (3, count or more): scratch.
void sort_pairs(Array<const Contact, 1> row, int64_t count, Array<ContactTrace, 1> trace, Array<int64_t, 2> sorting);

}  // namespace engine
