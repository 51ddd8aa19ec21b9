// Hertz's law of two elastic bodies that touch: stiffness, region, depth and duration; the flat punch beside it.
//
//     1/E* = Σ (1 − ν²)/E,   1/R* = κ₁ + κ₂                                          [Johnson 1985, eq. 4.24]
//     ball    N = k δ^{3/2},  k = (4/3) E* √R*,   a = (3NR*/4E*)^{1/3}               [Johnson 1985, eq. 4.22, 4.23]
//     impact  δ_max = (5m*v²/4k)^{2/5},   τ = 2.868 (m*²/(E*²R*v))^{1/5}             [Johnson 1985, eq. 11.22, 11.24]
//     punch   K = 2E*√(A/π) of a disc,   τ = π √(m*/K)                               [Johnson 1985, eq. 3.36]
//
// Strikes (pulse_shape, strike_forces), rolling and sliding (contact_oscillator) call it.
#pragma once

namespace engine {

// Compute E* in Pa of two moduli E/(1-ν²); infinite where both are rigid partners.
double contact_modulus(double low_pa, double high_pa);

// Compute k in N/m^{3/2} of a ball of R* on a plane of E*.
double ball_stiffness(double modulus_pa, double radius_m);

// Compute the patch's radius a in m under a load.
double ball_patch_m(double load_n, double modulus_pa, double radius_m);

// Compute the greatest depth of an impact. stiffness: k of `ball_stiffness`.
double impact_depth_m(double mass_kg, double stiffness, double approach_m_s);

// Compute τ of an impact of curved faces; infinite at no speed.
double impact_duration_s(double mass_kg, double modulus_pa, double relative_curvature_per_m, double approach_m_s);

// Compute τ of an impact of flat faces of an area, at any speed.
double punch_duration_s(double mass_kg, double modulus_pa, double area_m2);

}  // namespace engine
