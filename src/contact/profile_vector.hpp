// Loops of profile over lattice points and samples, eight at once.
#pragma once

#include <cstdint>

#include "../vector_level.hpp"

namespace engine {

// Points of an octave's lattice to be computed from those of the octave above.
struct Refinement {
    std::int64_t pairs;   // 2·pairs points
    std::uint32_t name;   // of surface and octave
    std::uint32_t first;  // number of the first point
    double around;        // points are counted round so many; 0: endless
    double height_m[2];   // of this octave's noise: at the step's start, and its growth until the end
};

// Where coefficients lie on the lattice, and how fast the samples sweep over it.
struct Reading {
    double origin;       // lattice point of the first coefficient, a whole number
    double per_m;        // lattice points a metre
    double speed_m_s;    // at the step's start
    double growth_m_s;   // until its end
    std::int64_t count;  // samples, a multiple of 8
};

struct ProfileVector {
    // Compute coefficients: those of coarse (pairs + 2,) on half the lattice, plus noise on ±1 by a 32-bit integer mix
    // [Wellons 2018, "lowbias32"]. The same for both, at the step's start and their growth until its end; up to 14
    // values more are written.
    void (*refine)(const Refinement& octave, const double* const coarse[2], double* const fine[2]);
    // Add dh/dt of samples at places (count,) in m, fractions x of the step, to rate_m_s.
    void (*read)(const Reading& reading, const double* place_m, const double* x, const double* const coefficient[2],
                 double* rate_m_s);
};
CHOOSE_VECTOR(ProfileVector, profile_vector)

}  // namespace engine
