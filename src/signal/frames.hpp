// Frames of a short-time transform: cut from samples under a window, and added up again.
//
//     x_m[n] = w[n] x[mH + n − N/2]        x[n] = Σ_m w[n − mH] x_m[n − mH]        [Griffin & Lim 1984, eq. 6]
#pragma once

#include "../array.hpp"

namespace engine {

// Cut frames (m, N), hop samples apart, under the window (N,); zeros outside of the samples.
void cut_frames(Array<const float, 1> sample, Array<const float, 1> window, int64_t hop, Array<float, 2> frames);

// Add frames (m, N) under the window to samples (n,), where they lie in them.
void add_frames(Array<const float, 2> frames, Array<const float, 1> window, int64_t hop, Array<float, 1> sample);

}  // namespace engine
