// Contact rows of one step: which contacts count, and what the synthesis needs of each.
//
//     loaded contacts (k,) + links at the step's start (n,) -> Contact rows, traces for the next step, bodies' poses
#pragma once

#include "listener_tables.hpp"
#include "surface_sweep.hpp"

namespace engine {

// In place of a number of rows.
constexpr int64_t UNKNOWN_LINK = -1;   // a contact of a link that is not in the roster
constexpr int64_t NEW_LINKS = -2;      // links in their first contact (LinkStart.met)
constexpr int64_t ABSURD_NUMBER = -3;  // a number beyond LARGEST_SI
constexpr int64_t UNUSUAL_STEP = -4;   // a case that Python has to handle (take_step)

// Fill rows (k,) and the newest trace from count loaded contacts; return the number of rows, or one of the above.
//     before   loaded contacts of the step before
//     dt_s, time_s   length and start of the step
// It does not count where it is asleep, where a body was moved by hand, or where a body in its first step is deeper
// inside its partner than its speed explains.
int64_t make_contact_rows(Array<const LoadedContact, 1> loaded, int64_t count, Array<const LoadedContact, 1> before,
                          Array<LinkStart, 1> start, double dt_s, double time_s, const TraceTables& traces,
                          Array<Contact, 1> row);

// Poses of a step's bodies, and which were moved by hand.
struct BodyPoses {
    Array<double, 2> position_m;       // (b, 3)
    Array<double, 2> quaternion_xyzw;  // (b, 4)
    Array<bool, 1> teleported;         // (b,)
};

// Write the poses of links that have an index, each to its row LinkStart.pose.
void place_bodies(Array<const LinkStart, 1> start, const BodyPoses& poses);

// A step of an unchanged roster, as it was read.
struct ReadStep {
    Array<const ReportedContact, 1> reported;  // after this step
    Array<const ReportedContact, 1> reported_before;
    Array<const LoadedContact, 1> before;  // loaded in the step before
    Array<const LinkState, 1> earlier;     // see begin_step
    Array<const LinkState, 1> later;
    Array<const int64_t, 1> moved_bodies;
    bool hooked;
    double dt_s;
    double time_s;
};

// What a step gives: tables to fill, and how much of them is.
struct StepTables {
    Array<LoadedContact, 1> loaded;
    Array<LinkStart, 1> start;
    Array<Contact, 1> row;
    BodyPoses poses;
};
struct StepCounts {
    int64_t loaded;
    int64_t rows;  // or why there are none
};

// Make a step. Unusual: a number is NaN or too large or, without hooks, a body was moved by hand or the step changed
// nothing. The state that outlives the step is not changed where there are no rows.
StepCounts take_step(const ReadStep& read, const TraceTables& traces, const StepTables& made);

}  // namespace engine
