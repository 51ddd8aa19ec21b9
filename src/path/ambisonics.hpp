// Ambisonics: what a body sends to a point, on spherical harmonics of the direction it comes from.
//
//     B_i(t) = Σ_b Y_i(u_b(t)) p_b(t),   i = l² + l + m (ACN), Y_i real, SN3D: Y_0 = 1, |Y_l|² sums to 1 over m
//         [Nachbar, Zotter, Deleflie, Sontacchi: ambiX, Ambisonics Symposium 2011, eq. 1-3]
//
// Plane waves: p_b has the 1/r of the true distance, its curvature is left out. Y is computed every 32 samples of a
// step and is straight between. b bodies, n samples, i channels, k steps.
#pragma once

#include "../array.hpp"

namespace engine {

constexpr int MOST_ORDER = 3;
constexpr int MOST_CHANNELS = (MOST_ORDER + 1) * (MOST_ORDER + 1);

// Evaluate Y (≥ (order + 1)², at least 4) of the direction of (x, y, z), of any length; all but the first 0 where that
// is 0.
void spherical_harmonics(double x, double y, double z, int64_t order, double* out);

// Add what bodies send, pressure (b, n), to out (1, i, n), or apart: (b, i, n).
// first, count (k,): of each step; along (n,): where between its ends each sample lies; away (k + 1, b, 3): to each
// body at its start.
void encode_ambisonics(Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
                       Array<const double, 2> pressure, Array<const double, 3> away, int64_t order,
                       Array<double, 3> out, bool apart);

}  // namespace engine
