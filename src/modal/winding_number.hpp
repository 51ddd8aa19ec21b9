// How often a surface winds round points: 1 inside and 0 outside of a closed one, between both at a hole.
//
//     w(p) = Σ_f Ω_f(p)/4π                                 [Jacobson, Kavan, Sorkine-Hornung 2013, eq. 5]
//     far groups of faces as one dipole each               [Barill et al. 2018, eq. 12]
#pragma once

#include "../array.hpp"

namespace engine {

constexpr int64_t DIPOLE_FACES = 8;    // faces that are one dipole from afar
constexpr int64_t DIPOLE_GROUPS = 8;   // groups that are one larger group
constexpr int64_t DIPOLE_LEVELS = 24;  // at most: 8^24 faces

// Fill winding (k,) of points (k, 3).
//     corner_m (f, 3, 3)  faces, neighbours one after the other
//     group (g, 7)        middle, dipole, and the distance from which it may replace its faces; level by level
//     first (l + 1,)      where each level begins, from the groups of faces up; the last has DIPOLE_GROUPS at most
void winding_numbers(Array<const double, 3> corner_m, Array<const double, 2> group, Array<const int64_t, 1> first,
                     Array<const double, 2> point_m, Doubles winding);

}  // namespace engine
