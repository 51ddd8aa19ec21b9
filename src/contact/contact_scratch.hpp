// Memory that the contact stages need for the length of a call: kept between calls, so that it grows rarely.
#pragma once

#include <vector>

#include "../tables.hpp"

namespace engine {

// Return room for `count` elements, whose values are left as they are; grown where it is too small.
template <class T>
Array<T, 1> room(std::vector<T>& memory, int64_t count) {
    if (static_cast<int64_t>(memory.size()) < count) memory.resize(count);
    return {memory.data(), {count}};
}

// The law of a contact in one step, in the units of contact_oscillator; arrays: at the step's start and its end.
struct ContactLaw {
    double depth;  // the pair's state, z and u, in this law's units
    double separation_speed;
    double rest_depth[2];  // δ0
    double damping[2];     // c
    double rate_unit;      // of dh/dt, per m/s
    double force_unit_n;
    double substeps;
    double patch_m[2];   // radius of the contact patch
    double touching[2];  // fraction of it that is in contact
    bool still;          // its surfaces do not sweep
};

struct ContactScratch {
    std::vector<int64_t> key, order, other;                      // contacts of a step, as they are sorted
    std::vector<int64_t> merged;                                 // places of pairs
    std::vector<double> gravity_steps, transmitted_n_s, when_s;  // bodies
    std::vector<int64_t> waiting, points;                        // bodies
    std::vector<ContactLaw> laws;
    std::vector<double> rate_m_s, lattice;  // contact oscillators
    std::vector<Strike> strikes;            // for the caller: one for each active pair, as voices
    std::vector<Voice> voices;
};

}  // namespace engine
