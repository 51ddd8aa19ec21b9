// Sums of modes, sample by sample: linear ones by recursion, level-dependent ones in closed form.
//
//     linear             x_m(t) = Re A e^{(−d + iω)t}
//     growth c           ȧ = −d a (1 + c (a/a₀)^p)      ->  a(t)/a₀ = ((1 + c) e^{pdt} − c)^{−1/p}, p = 1, 2
//         (Bernoulli's equation)
//     bend b             ω(t) = ω (1 + b a²(t))         ->  phase ω(t + b ∫a²dt)
//
// a is the mode's level (peak velocity at the surface); ∫a² dt = a₀² (1 − e^{−2dt})/2d without damping growth;
// a₀² ln(1 + c − c e^{−2dt})/2dc with p = 2; and with p = 1, u = e^{dt}, k = c/(1 + c):
//     ∫ a² dt = a₀²/(d (1 + c)²) ∫₁ᵘ dv/(v (v − k)²) = a₀²/(d (1 + c)²) [ln(v/(v − k))/k² − 1/(k (v − k))]₁ᵘ.
#pragma once

#include "../array.hpp"
#include "../math/elementary.hpp"
#include "../row_fields.hpp"

namespace engine {

// Samples from one phasor that is computed to the next: those between are made from the one before.
constexpr int64_t EXACT_EVERY = 1024;

// Modes (m,) that depend on their level. bend, damping_growth: relative changes at the level the mode starts with,
// bend·level² and (damping_growth·level)^power.
struct LevelModes {
    Array<const double, 1> omega_rad_s;
    Array<const double, 1> decay_per_s;
    Array<const Complex, 1> amplitude;
    Array<const double, 1> bend;
    Array<const double, 1> damping_growth;
    double power;
};
GROUP_FIELDS(LevelModes, omega_rad_s, decay_per_s, amplitude, bend, damping_growth, power)

// Add Re A e^{s (n − start)} to sound (n,), from the sample at or after start on: so many samples of each mode.
// log_pole: s in 1/sample.
void add_linear_modes(Array<const Complex, 1> log_pole, Array<const Complex, 1> amplitude,
                      Array<const int64_t, 1> length, double start, Doubles sound);

// Add modes with ω(t) and d(t) that depend on the mode's level.
void add_level_modes(const LevelModes& modes, Array<const int64_t, 1> length, double start, double sample_rate_hz,
                     Doubles sound);

}  // namespace engine
