// Heights A_j of a rough surface's octaves, once a pair, as `profile` plays them: scaled for lattice values on ±1.
//
//     rms height and Hurst exponent, or rms heights by octave -> A_j -> + waves of manufacture
//         -> what a ball follows of them, what closes round a body
//
// Octave j holds wavelengths LONGEST_WAVE_M / 2^j, √2 to either side: sonic_bullet/records/roughness.py.
#pragma once

#include "../tables.hpp"

namespace engine {

constexpr double LONGEST_WAVE_M = 0.1;
// An octave on a lattice Δ carries most of the self-affine spectrum at λ = Δ/0.30: there x^2.5 sinc(x)^8 peaks.
constexpr double OCTAVE_LATTICE = 0.30;
// √(3·315/151) makes n_j unit variance: lattice values uniform on ±1 have 1/3, the mean square of the B-spline is
// 151/315.
constexpr double UNIT_RMS = 2.501655081280264;

struct OctaveWaves {
    double length_m[OCTAVES];
    constexpr double operator[](int j) const { return length_m[j]; }
};
constexpr OctaveWaves octave_waves() {
    OctaveWaves waves{};
    double length_m = LONGEST_WAVE_M;
    for (double& one : waves.length_m) one = length_m, length_m /= 2.0;
    return waves;
}
constexpr OctaveWaves WAVE_M = octave_waves();  // by octave

using Octaves = double[OCTAVES];

// Write A_j in m from rms height in m and Hurst exponent.
void height_octaves(double roughness_m, double hurst, Octaves& height_m);

// Write A_j in m from rms heights in m.
void given_octaves(const Octaves& octave_rms_m, Octaves& height_m);

// Add waves of one length, in power, in the octave that it is in.
void add_waves(double rms_m, double length_m, Octaves& height_m);

// Return the mean square slope of a trace over heights A_j: Σ (2πσ/λ)².
double slope_squared(const Octaves& height_m);

// Compute the largest A of waves that a ball of R* with a Hertz patch a follows.
//
// Over waves of amplitude A and crests sharper than the ball its centre moves on arcs about them, λ apart, that fall by
// λ²/8R [ISO 16610-41:2015, closing by a disc, of one wave]; and it sinks by Hertz' depth a²/R. So A is at most
// (λ²/16 + a²)/R.
double reach_of_ball(double wave_m, double patch_radius_m, double radius_m);

struct ClosedLattice {
    double points;   // of the coarsest octave's lattice round the length
    double stretch;  // of the lattice, over 1
};

// Close the lattice round a length: a whole number, 4 to 7, of the points of the coarsest octave that has as many.
//
// Coarser heights are 0 then: waves nearly as long as the body is round only carry it.
ClosedLattice close_round(double length_m, Octaves& height_m);

}  // namespace engine
