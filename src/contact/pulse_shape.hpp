// Force pulse of a strike: its length, its shape, and the reduction of its impulse by compliant bodies.
//
//     1/m* = Σ [1/m + (r×n)·I⁻¹(r×n)]            effective mass at the contact
//         [Johnson 1985, Contact Mechanics, sec. 11.1]
//     τ = τ(m*, E*, R*, v) of curved faces, τ(m*, E*, A) of flat ones                hertz.hpp
//     δ'' = -δ^(3/2),  F ∝ δ^(3/2)               the Hertz pulse's own shape; flat: F ∝ sin(πt/τ)
//
// All reads use the table of the cumulated force Q(s) = ∫F over the fraction s of the pulse in [0, 1] (Q(1) = 1). For
// the Hertz pulse Q = (1 - δ'/v)/2, because the force is what changes the velocity.
#pragma once

#include "../array.hpp"

namespace engine {

// A pulse of 1 µs has its -3 dB point at 600 kHz: no rate resolves a shorter one; above 50 ms nothing audible is
// struck.
constexpr double SHORTEST_PULSE_S = 1e-6;
constexpr double LONGEST_PULSE_S = 50e-3;
constexpr int SPECTRUM_CELLS_PER_F_TAU = 40;  // of the table of pulse spectra: linear between its points, 0 beyond

constexpr int PULSE_CELLS = 1024;

// Q and F of the Hertz pulse at equidistant fractions.
struct PulseTable {
    double q[PULSE_CELLS + 1];
    double force[PULSE_CELLS + 1];
};

const PulseTable& pulse_table();

// Interpolate Q at the fraction s of the pulse: 0 before it, 1 after.
double cumulated(double s, bool flat);

struct PulseLength {
    double tau_s;
    int64_t flat;  // 1: a half-sine, 0: Hertz'
};

// Compute the length of a pulse.
//
// A contact is never stiffer than the flat punch that its area allows, so the longer τ counts. Without area Hertz
// decides alone, without curvature the punch. With neither, with infinite mass or at no speed τ is LONGEST_PULSE_S.
// Clamped to SHORTEST_PULSE_S … LONGEST_PULSE_S. relative_curvature_per_m: κ1+κ2, zero or below where the faces
// conform; flat_area_m2: nominal contact area, 0 where none is known.
PulseLength pulse_length(double mass_kg, double modulus_pa, double relative_curvature_per_m, double flat_area_m2,
                         double approach_m_s);

// Compute how many times as long Hertz' pulse is on rough faces: by as much as its peak force is smaller.
//
// The rough layer of stiffness f/u₀ [Persson 2007, PRL 99, 125502] lies in series with the bulk and takes u₀f of
// energy: 2/5 k^(-2/3) f^(5/3) + u₀ f = ½ m* v². Impulse and shape are kept. layer_m: u₀.
double rough_stretch(double mass_kg, double modulus_pa, double relative_curvature_per_m, double approach_m_s,
                     double layer_m);

// Compute Σ (Uᵀj |F̂(fτ)|)² over one body's modes.
//
// The first contact of compliant bodies transmits 1/(1 + m*/j² · this sum, of both bodies) of a rigid body's impulse. A
// mode's motion within the pulse reduces the approach as if its 1/g², g = Uᵀj/j, were one more mass in series with m*
// [1/m = 1/m* + Σ g²: the first equation above, with the modes as further motions of the bodies, e.g. Stronge 2000,
// Impact Mechanics, sec. 7.1]. So the modes' energy is bounded by m*v²/2·((1+e)/2)². The rest of the simulator's
// impulse comes later, softly: it is rendered as support. modal_impulse, frequency_hz (modes,); spectrum: |F̂(f)/F̂(0)|
// at equidistant f·τ.
double compliance(const double* modal_impulse, const double* frequency_hz, int64_t modes, double tau_s,
                  Array<const double, 1> spectrum);

}  // namespace engine
