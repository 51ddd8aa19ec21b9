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

struct ContactScratch {
    std::vector<int64_t> key, order, other;                      // contacts of a step, as they are sorted
    std::vector<int64_t> merged;                                 // places of pairs
    std::vector<double> gravity_steps, transmitted_n_s, when_s;  // bodies
    std::vector<int64_t> waiting, points;                        // bodies
    std::vector<double> law, rate_m_s, lattice;                  // contact oscillators
    std::vector<Strike> strikes;                                 // for the caller: one for each active pair, as voices
    std::vector<Voice> voices;
};

}  // namespace engine
