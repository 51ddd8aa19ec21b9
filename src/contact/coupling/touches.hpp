// Touches of a body on others: each point of its contact patches with the motion of both bodies, and its spring.
//
//     ContactPatch of each of its pairs -> place_points: Φ of both -> region that touches -> contact_spring
//
//     K_c: a region with half-axes a >= b acts as the flat punch of its outline      2 M(a, b) E*, M: arithmetic-
//                                                       geometric mean [Green & Sneddon 1950; A&S 17.6.3]
//     a, b   point: √(ab) = (3N/4E*κ)^{1/3};  line: b = √(2N/πE*aκ)   [Johnson 1985, eq. 4.28, 4.43]
//            face: ellipse of the rectangle's area and aspect
//     1/K = (1/K_c + u₀/N)/(1 + jη),   K_t/K = 2(1 − ν)/(2 − ν)        [Persson 2007; Johnson 1985, eq. 7.42, 7.44]
//
// The same springs as coupling/springs.py, which says what they are, at every point of a scene's patches.
#pragma once

#include <complex>

#include "../../groups.hpp"

namespace engine {

constexpr int POINTS = 4;  // most of a patch

// Elastic properties of the bodies (b,) where they are touched.
struct TouchSides {
    Array<const double, 1> compliance_per_pa;  // (1 − ν²)/E, 0 of a rigid partner
    Array<const double, 1> poisson;
    Array<const double, 1> loss_factor;
    Array<const double, 1> roughness_m;
    Array<const bool, 1> slips;    // no friction: nothing is held sideways
    Array<const double, 3> turns;  // (b, 3, 3) J^{−1/2}, by columns
};
GROUP_FIELDS(TouchSides, compliance_per_pa, poisson, loss_factor, roughness_m, slips, turns)

// The c touches of a body, in the order of its pairs and their points.
struct Touches {
    Array<double, 2> own;                   // (3c, N) Φ of the body, zeros at first
    Array<double, 2> other;                 // (3c, P) of all partners side by side, zeros at first
    Array<std::complex<double>, 1> spring;  // (3c,) along the normal and both tangents
    Doubles load_n;                         // (c,)
};
GROUP_FIELDS(Touches, own, other, spring, load_n)

// Fill the touches of body b: of its pairs in these places (k,), the partner's columns of other from begin (k,) on.
void fill_touches(int64_t b, Array<const int64_t, 1> places, Array<const int64_t, 1> begin, const BodyTables& tables,
                  const PairTables& pairs, Array<const double, 2> quaternion, const TouchSides& sides,
                  const Touches& touches);

}  // namespace engine
