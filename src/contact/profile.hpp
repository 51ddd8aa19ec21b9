// Height profile of a surface, read at the distance it has swept: endless self-affine noise.
//
//     PSD(κ) ∝ κ^-(1+2H)  for wavelengths from LONGEST_WAVE_M down to LONGEST_WAVE_M / 2^(OCTAVES-1),  flat above
//         [Mandelbrot; Persson 2005]
//     h(x) = Σ_j g_j A_j n_j(x/Δ_j),   A_j ∝ Δ_j^H,  Σ A_j² = rms²,  Δ_j = LONGEST_WAVE_M·OCTAVE_LATTICE / 2^j
//     n_j: cubic B-spline (C²) on hashed lattice values of unit variance
//
// The rms height of a Material is that of a 100 mm long trace. The Rq of a stylus instrument with a cut-off of 0.8 mm
// is (0.8/100)^H of it: 1/37 at H = 0.75. So smooth glass has some 0.1 µm, a sanded board 20 µm.
//
// Gains g_j (an octave's wavelength is λ_j):
//     contact patch   (1 + a/λ)^(-1/2), a: Hertz' radius: a rough contact rests on about 1 + a/λ independent spots and
//                     follows their mean; -3 dB at λ = a, that is at v/a. (Remington's filter, [1987] and [Thompson
//                     2003], averages full, smooth contact and falls three times as steeply. With it the level grows
//                     with speed to the power 1.1 … 1.6: measured, 0.5 … 0.96.)
//     anti-aliasing   1 below 0.2 sr at v/λ, falling to 0 at 0.4 sr
//     slow waves      1 above 16 Hz, falling to 0 at 8 Hz: they only lift the body, inaudibly
// Where the fraction c of the patch is in contact, the patch averages that part as a smooth one:
//     (1 - c)(1 + a/λ)^(-1/2) + c (1 + π/4 (2πa/λ)³)^(-1/2),   c = erf(√π p/(E* h'))    h': rms slope, p: mean pressure
//         [Remington 1987, J. Acoust. Soc. Am. 81, 1805; Pastewka & Robbins 2016, Appl. Phys. Lett. 108, 221601]
//
// A round body's profile closes on itself: the lattice is stretched so that a whole number of points goes round, and
// the last is followed by the first.
//
// The contact oscillator needs dh/dt alone: Σ g A n'(x/Δ)·v/Δ. So a changing gain never moves a surface at rest, and
// v = 0 is exactly 0.
//
// Data flow: octave_heights once a pair, gained_heights once a step and side, sweep_profile: dh/dt of every sample. The
// lattices nest, so the octaves are summed from coarse to fine on the lattice points that the samples pass (a cubic
// B-spline on Δ is one on Δ/2 with the coefficients [1 4 6 4 1]/8; `refine`) and read once a sample (`read`: the
// derivative is the quadratic B-spline of the differences). A coefficient depends on its place alone, so where a block
// begins makes no difference.
#pragma once

#include <vector>

#include "octave_heights.hpp"

namespace engine {

// A contact patch, for what it averages.
struct Patch {
    double radius_m;
    double touching;  // fraction of it that is in contact, 0 where only spots are
    double ball_m;    // R* of a ball that follows no more of the waves than it can, 0 where that is not asked
};

// Write g_j A_j at a sweep speed, not negative.
void gained_heights(const Octaves& height_m, double speed_m_s, const Patch& patch, double sr, Octaves& gained_m);

// A surface: its key, and how its lattice closes round it (close_round); points 0: endless.
struct RoughSurface {
    int64_t seed;
    ClosedLattice around;
};

// Add dh/dt of one side of one pair to samples (n,) in m/s; return the distance swept after them.
//
// swept_m: distance before; speed_m_s, height_m (g·A): at the step's ends; x (n,): fraction of the step. rate_m_s is
// as long as if n were the next multiple of 8. lattice: memory, grown where it is too short.
double sweep_profile(double swept_m, const double (&speed_m_s)[2], Array<const double, 1> x,
                     const RoughSurface& surface, const double (&height_m)[2][OCTAVES], double per_sample_s,
                     double* rate_m_s, std::vector<double>& lattice);

}  // namespace engine
