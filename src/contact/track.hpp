// A measured track, played height by height: dh/dt of its slopes by octave at the distance swept, round and round.
//
//     dh/dt = v Σ_j g_j s_j(x mod L)        s_j: slope of the track's waves in octave j   [records/roughness.py]
//
// Slopes are linear between their places, four a wave of the finest octave. Gains g_j are those of `profile`.
#pragma once

#include "octave_heights.hpp"

namespace engine {

struct Track {
    const double* slopes;  // (OCTAVES, count)
    int64_t count;         // of an octave
    double spacing_m;
};

// Add dh/dt of one side of one pair to samples (n,) in m/s; return the distance swept after them.
//
// swept_m: distance before; speed_m_s, gains: at the step's ends; x (n,): fraction of the step.
double sweep_track(double swept_m, const double (&speed_m_s)[2], Array<const double, 1> x, const Track& track,
                   const double (&gains)[2][OCTAVES], double per_sample_s, double* rate_m_s);

}  // namespace engine
