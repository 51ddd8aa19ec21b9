// A head's two ears: what a body sends, through the responses of the direction that it comes from, which
// engine/path/space/ear_filters.py mixes of the measured ones. Within a step the sound fades from the filter of its start to
// that of its end. b bodies, n samples, t taps, k steps.
#pragma once

#include "../array.hpp"

namespace engine {

// Add what bodies send, pressure (b, n), through filters (k + 1, b, 2, t) to out (1, 2, n), or apart: (b, 2, n).
// Filters are those of each step's start. past (b, t - 1): what they sent before, then what they send now; first,
// count, along: as `encode_ambisonics` has them. scratch (t - 1 + n,).
void filter_ears(Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
                 Array<const double, 2> pressure, Array<double, 2> past, Array<const double, 4> response,
                 Array<double, 3> out, bool apart, Array<double, 1> scratch);

}  // namespace engine
