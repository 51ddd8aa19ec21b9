// Groups of tables that more than one stage takes; each field is named as where Python keeps it.
#pragma once

#include "array.hpp"
#include "row_fields.hpp"
#include "tables.hpp"

namespace engine {

// Tables of one step: pulses and drives in, sound out. d drives, b bodies, W weight sets, n samples or more.
struct ScratchTables {
    Integers count;                  // (2,): pulses, drives
    Array<Pulse, 1> pulse;           // of the step and those found ahead of it
    Array<double, 3> modal_impulse;  // (pulses, 2, columns) Uᵀj of the whole impulse on both bodies
    Doubles force;                   // flat (d, n) in newton
    Array<double, 3> gain0;          // (d, 2, columns) of both bodies at the step's start, and at its end
    Array<double, 3> gain1;
    Array<double, 2> direction0;  // (d, 3) of the force on the lower body, the negative on the higher
    Array<double, 2> direction1;
    Array<int64_t, 2> body;        // (d, 2), -1 for nobody
    Integers slot;                 // (d,) of the drive's pair
    Array<double, 3> source;       // (W, b, n)
    Array<double, 3> transmitted;  // (W, b, n) by bodies that touch; n = 0 where nothing is transmitted
    Array<double, 3> dipole;       // (b, 3, n)
    Array<int64_t, 2> sounds;      // (b, 2): 1 where a body's rows of source, of dipole are not zero
};
GROUP_FIELDS(ScratchTables, count, pulse, modal_impulse, force, gain0, gain1, direction0, direction1, body, slot,
             source, transmitted, dipole, sounds)

}  // namespace engine
