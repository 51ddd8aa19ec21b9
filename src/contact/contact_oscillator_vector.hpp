// The contact oscillators of eight pairs at once, one a lane.
#pragma once

#include <cstdint>

#include "../vector_level.hpp"

namespace engine {

// Eight contact laws and states, a lane each: see ContactLaw.
struct OscillatorLanes {
    double depth[8];
    double separation_speed[8];
    double rest_depth[8];
    double rest_growth[8];  // until the step's end
    double damping[8];
    double damping_growth[8];
    double rate_unit[8];
    double force_unit_n[8];
    double substeps[8];
    double still[8];             // 1 or 0
    std::int64_t most_substeps;  // among them
};

struct OscillatorVector {
    // Replace dh/dt (8, length) at `count` samples by f - N; the states advance. x (count,): fractions of the step.
    void (*oscillate)(OscillatorLanes& lanes, const double* x, std::int64_t count, double* rate, std::int64_t length);
};
CHOOSE_VECTOR(OscillatorVector, oscillator_vector)

}  // namespace engine
