// Emission of a moving point and its fractionally delayed arrival, eight samples at a time: one line of the sound path,
// from one place of a body to one microphone.
//
//     emitted at sample m:   a[m] = (s[m] + n̂·j[m])/r[m],  arriving at m + D[m], D = r sr/c
//     heard at sample n:     a(u), where u + D(u) = n, D linear between samples: m + D[m] ≤ n < m + 1 + D[m + 1],
//         u = m + (n - m - D[m])/(1 + D[m+1] - D[m])                          (retarded time: Doppler shift is exact)
//     a(u) = Σ_k a[k] h(u - k),  h: 24 taps of a Kaiser-windowed sinc
//         [Laakso et al. 1996, IEEE SPM 13(1), sec. 3.2]
//
// Taps are polynomials in the fraction [Farrow 1988]. Each lane is one sample, and its result depends on that sample
// alone: groups may begin anywhere. Samples of equal fraction share their taps (a body that stands still), with the
// same bits as if each had computed its own.
//
// A line's history lies in the path's memory from place.memory_at + c·2·(size + MIRRORED) on: emitted, then delays,
// both rings of a power of two with their first MIRRORED elements repeated at their ends, so that reads are contiguous.
#pragma once

#include "../flush.hpp"
#include "../tables.hpp"
#include "../vector_level.hpp"

namespace engine {

constexpr int TAPS = 24;
constexpr int AHEAD = TAPS / 2;  // of them behind the sample that is read: the least delay, in samples
constexpr int MIRRORED = TAPS + LANES;
constexpr int PATH_BLOCK = 256;  // samples of one line at a time
constexpr int HALF_DEGREE = 4;   // of the polynomials in t²
// Sound emitted one sample later arrives at least 1/16 sample later: a source at or above the speed of sound is not
// overtaken by its own sound.
constexpr double MOST_FALL = 1.0 - 1.0 / 16.0;

// Polynomials in t², t = fraction - ½, lowest power first, of the even and odd parts of taps 0 … 11: tap k weighs
// sample floor(u) - 11 + k; tap 23 - k at t is tap k at -t: h = even ± t·odd serves both. Fitted to 1e-8.
struct TapPolynomials {
    double power[HALF_DEGREE + 1][2][2 * LANES];  // 0 behind the twelfth
};
const TapPolynomials& tap_polynomials();

// History of one line.
struct Ring {
    double* emitted;
    double* delay;
    int64_t mask;  // size less one
};

// What a body emits at samples of a block, on its way from the step's start to its end.
struct MovingSource {
    const double* pressure;   // s, Pa·m
    const double* dipole[3];  // j along each axis, Pa·m
    const double* x;          // place of each sample between the step's ends, 0 … 1
    double way_m[3];          // from the body to the microphone at the step's start
    double moved_m[3];        // the body's, less the microphone's, until the step's end
    double samples_per_m;
    double most_per_m;  // 1/radius: r is never below
};

// A block of one line, whole groups of eight: what leaves the source, how many samples later it arrives, what arrives.
struct LineBlock {
    double emitted[PATH_BLOCK + LANES];
    double delay[PATH_BLOCK + LANES];
    double observed[PATH_BLOCK + LANES];
};

// The taps computed last for samples of one t; NaN at first.
struct KeptTaps {
    double t;
    double tap[TAPS];
};

struct Loudness {
    bool any;     // not all are zero
    bool finite;  // all are
};

struct FractionalDelay {
    // Find whether a source (count,) or one of its three axes, stride apart, emits anything, and whether it can be.
    Loudness (*loudness)(const double* source, const double* dipole, int64_t stride, int64_t count);
    // Compute a and D of count samples into a block; true where a delay falls by more than MOST_FALL from one to the
    // next.
    bool (*emit)(const MovingSource& source, int64_t count, LineBlock& block);
    // Run one line over block.emitted (n,) from absolute sample ``at`` on and write its arrivals into block.observed
    // (n,). False where nothing arrives. steep: what `emit` returned.
    bool (*listen)(Line& line, int64_t at, int64_t n, bool steep, const Ring& ring, const TapPolynomials& taps,
                   KeptTaps& kept, LineBlock& block);
    // Multiply what is emitted by factors that go straight from one to the other over the step.
    void (*scale)(double* emitted, double begin, double end, const double* x, int64_t count);
    void (*add)(const double* values, double* out, int64_t count);
    void (*flush)(double* out, int64_t count);  // what is below FLUSH: 0
};
CHOOSE_VECTOR(FractionalDelay, fractional_delay)

}  // namespace engine
