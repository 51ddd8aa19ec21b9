// Spectrograms of residuals: modes to subtract, inversion with momentum, transfer to another body's modes.
//
//     inversion   S ← A·Q/|Q|,  Q = C + μ (C − C before)                                [Perraudin et al. 2013, alg. 2]
//     transfer    A(f) = Σ_k a_t,k² h_k(f) / Σ_k a_s,k² h_k(f),  h_k = 1/(1 + (f − f_s,k)²/b_k²)
//                 P_t(f_t, t) = A(f_s) P_s(f_s, t d_t/d_s) |df_s/df_t|        [Ren, Yeh, Lin 2013, eq. 28-29, alg. 1]
#pragma once

#include "../array.hpp"
#include "../math/elementary.hpp"

namespace engine {

// Add Re a p^n of lines (l,) to sound (n,), each for its length in samples.
void add_damped_lines(Array<const Complex, 1> pole, Array<const Complex, 1> amplitude, Array<const int64_t, 1> length,
                      Doubles sound);

// Set spectrum ← magnitude·Q/|Q|, Q = spectrum + momentum (spectrum − before); before ← the former spectrum. (m, k)
void renew_phases(Array<ComplexFloat, 2> spectrum, Array<ComplexFloat, 2> before, Array<const float, 2> magnitude,
                  float momentum);

// Fill ratio (k,) with A at frequencies (k,), from pairs (p,) of modes at centre_hz, of skirts half_hz, and their
// powers on both sides.
void power_ratios(Array<const double, 1> freq_hz, Array<const double, 1> centre_hz, Array<const double, 1> half_hz,
                  Array<const double, 1> source_power, Array<const double, 1> target_power, Doubles ratio);

// A power spectrogram (b, n) over its axes, bilinear between the points.
struct PowerMap {
    Array<const double, 1> freq_hz;
    Array<const double, 1> time_s;
    Array<const double, 2> per_hz;
};

// Fill moved (k, n) with level·P(source_hz, rate·time_s); zero above and after the map. row (times of the map,):
// scratch.
void move_power(const PowerMap& power, Array<const double, 1> source_hz, Array<const double, 1> level,
                Array<const double, 1> rate, Array<const double, 1> time_s, Doubles row, Array<double, 2> moved);

}  // namespace engine
