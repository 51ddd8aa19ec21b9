// Sound path of one step, or a part of it: what bodies emit -> pressure at the microphones.
//
//     source, dipole, poses -> is each number finite, does every history reach far enough?  (places.hpp: nothing has
//         changed so far)
//       -> a teleported body gets a new place, its old one fades out over the step
//       -> each body's places, by when it came there, and microphones: emitted -> histories (fractional_delay.hpp)
//       -> what arrives, summed in this order -> out
//
// A line sleeps until something is emitted and again when the last of it has arrived. That is decided sample by sample,
// so frames do not matter. b bodies, c microphones, t places.
#pragma once

#include "../tables.hpp"

namespace engine {

// What `hear` returns: but for PATH_DONE nothing has changed. After the two that follow it may be called again with
// longer tables: a place's size is below its need; one more place a body is enough.
enum PathStatus : int64_t { PATH_DONE = 0, MEMORY_SHORT = 1, PLACES_SHORT = 2, TOO_FAR = 3, NOT_FINITE = 4 };

constexpr double FARTHEST_M = 1000.0;  // of what sounds from a microphone

// The sound path's constants and its state, which `hear` changes in place; engine/path/propagation.py makes and lengthens it.
struct PathTables {
    Array<const double, 2> microphone_m;  // (c, 3)
    double samples_per_m;
    Array<Source, 1> sources;  // (b,)
    Array<Place, 1> places;    // (t,)
    Array<Line, 1> lines;      // (t·c,): place·c + microphone
    Array<double, 1> memory;   // histories of the lines: see fractional_delay.hpp
};
GROUP_FIELDS(PathTables, microphone_m, samples_per_m, sources, places, lines, memory)

// What bodies emit, from column ``first`` on, in Pa·m.
struct Emission {
    Array<const double, 3> source;  // (W, ≥ b, ·) of each weight set
    Array<const double, 3> dipole;  // (≥ b, 3, ·) along each axis
    int64_t first;
    Array<const int64_t, 1> sets;  // (c,) weight set that each microphone hears
};
GROUP_FIELDS(Emission, source, dipole, first, sets)

// Where bodies and microphones are in a step.
struct Course {
    Array<const double, 2> begin_m;   // (≥ b, 3)
    Array<const double, 2> end_m;     // (≥ b, 3)
    Array<const bool, 1> teleported;  // (≥ b,)
    Array<const double, 1> x;  // (·) place of each sample between the step's ends, 0 … 1, from column Emission.first on
    Array<const double, 4> aim_m;  // (2, b, c, 3) place of each microphone when it receives what a body emits at the
                                   // step's ends; (0, …): as microphone_m
    Array<const double, 3> gain;  // (2, b, c) factor of what a body emits to a microphone at the step's ends; (0, …): 1
};
GROUP_FIELDS(Course, begin_m, end_m, teleported, x, aim_m, gain)

// Where pressure goes: out (c, ·) from column ``at`` on; apart 1: bodies are not summed, out is (b·c, …).
struct Arrivals {
    Array<double, 2> out;
    int64_t at;
    int64_t apart;
};
GROUP_FIELDS(Arrivals, out, at, apart)

// Compute the pressure (Pa) at samples at … at + n - 1, of step ``step`` ≥ 0, into an `Arrivals`: a `PathStatus`.
// Bodies are summed in order; below 1e-30 Pa: 0.
int64_t hear(int64_t at, int64_t step, int64_t n, const Emission& emission, const Course& course,
             const PathTables& path, const Arrivals& arrivals);

}  // namespace engine
