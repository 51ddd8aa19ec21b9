// Driven modes of the bank, some tens of samples at a time, as vector instructions.
//
//     forces      push[n] = Σ (a0 g0 + a1 g1)                                a0 = F·period·(1 - x), a1 = F·period·x
//     strikes     impulse[n] += r Σ_k J_k D^(K-k),   r <- r E                `strike_pool`
//     modes       f <- f p + (1 + i d/ω) push[n] + impulse[n],   partial[n] += Re(w f)
//     sound       y[n] = Σ over lanes of partial[n]
//
// State, poles and weights are flat (2·modes,), real parts first. A body's lanes come in whole groups of 16, whose
// state stays in registers. Of each 16 lanes and DRIVEN samples: push, 16 numbers a sample; impulse, 32: real parts,
// then imaginary ones. partial (samples, 8).
#pragma once

#include "../vector_level.hpp"
#include "layout.hpp"

namespace engine {

constexpr int64_t SAMPLE_NUMBERS = 2 * LANE_PAIR;  // of the impulse, a sample and 16 lanes

// Forces of a body: side[first … stop - 1], 2·drive + side of each, in order. signal: flat (drives, 2, stride),
// impulses a0 and a1.
struct BodyForces {
    const int64_t* side;
    int64_t first;
    int64_t stop;
    const double* signal;
    int64_t stride;
};

// Gains at both ends of a step, flat (2·drives, columns), read from ``column`` on.
struct ForceGains {
    const double* gain0;
    const double* gain1;
    int64_t columns;
    int64_t column;
};

// Driven modes: flat (2·modes,); lanes start … start + count - 1, count whole sixteens. weight: of ``start``, its
// imaginary part ``modes`` later.
struct DrivenModes {
    double* state;
    const double* pole;
    const double* weight;
    const double* quadrature;  // d/ω of ``start`` …
    int64_t modes;
    int64_t start;
    int64_t count;
};

// A strike's phasors r, D, E0, E1, real and imaginary in turn, ``width`` apart, from a body's lane on; and its plan at
// the samples of span.
struct StrikePhasors {
    double* rows;
    int64_t width;
    const NodePlan* plan;
    const double* due;
    int64_t first;
    int64_t stop;
};

// Impulses of a strike's nodes, a spacing apart, and how long before its sample the last of them acts.
struct NodeGroup {
    const double* impulse;
    int64_t count;
    double late;
};

struct Drive {
    // Compute a0 and a1 (n,) of a force (n,) in newton; impulses below FLUSH are 0.
    void (*part_force)(const double* force_n, const double* progress, double period_s, int64_t n, double* early,
                       double* late);
    // Copy values (n,); those below FLUSH are 0. In place where out is values.
    void (*copy_flushed)(const double* values, int64_t n, double* out);
    // Set push to all forces of a body on ``lanes`` lanes, ``count`` samples from ``at`` on.
    void (*project_forces)(double* push, const ForceGains& gains, const BodyForces& forces, int64_t at, int64_t lanes,
                           int64_t count);
    // Set impulse of ``lanes`` lanes and ``count`` samples to 0.
    void (*clear)(double* impulse, int64_t lanes, int64_t count);
    // Add a strike's impulses: r <- r·E, impulse += r·Horner(due, D). keep: false leaves r as it was.
    void (*strike)(double* impulse, const StrikePhasors& strike, int64_t lanes, bool keep);
    // Advance modes by ``count`` samples; partial += Re(w f). impulse, push: null for none. keep: false leaves the
    // state as it was.
    void (*run)(const DrivenModes& modes, const double* impulse, const double* push, int64_t count, double* partial,
                bool keep);
    // Sum the impulses of all forces along each axis: axis_impulse (3, 2·stride) = Σ ± (a0 d0 + a1 d1), ``count``
    // samples. direction0, direction1: flat (drives, 3), on the lower body, the negative on the higher.
    void (*sum_forces)(double* axis_impulse, const BodyForces& forces, const double* direction0,
                       const double* direction1, int64_t count);
    // Sum partial (count, 8) over the lanes into out (count,).
    void (*across)(const double* partial, int64_t count, double* out);
    // Fill rows, ``width`` apart, with r = gain·fraction·(1 + i d/ω) e^{s·times[0]}, and D, E0, E1 = e^{s·times[1…3]},
    // real and imaginary in turn, of ``lanes`` lanes. law: of the first lane, its rows ``modes`` apart; gain (lanes,).
    void (*phasors)(double* rows, int64_t width, const double* law, int64_t modes, int64_t lanes, const double* gain,
                    double fraction, const double (&times)[4]);
    // Fill rows 8 and 9 with all that a strike adds to each mode, summed over the samples to come:
    // Σ_groups r e^{s (late - late of the first)} Σ_k J_k D^(K-k) / (1 - e^s), by r and D of rows 0 to 3.
    void (*sum_strike)(double* rows, int64_t width, const double* law, int64_t modes, int64_t lanes,
                       const NodeGroup (&groups)[2]);
    // Sum -Re(w K) over lanes, K: real and imaginary parts. weight: of the first lane, imaginary ``modes`` later.
    double (*lasting_strike)(const double* weight, int64_t modes, const double* re, const double* im, int64_t lanes);
    // Set lasting to -Re(w (1 + i d/ω) / (1 - e^s)) of modes.count lanes: of an impulse at each sample, for ever.
    void (*lasting_forces)(const DrivenModes& modes, double* lasting);
    double (*dot)(const double* a, const double* b, int64_t lanes);
};
CHOOSE_VECTOR(Drive, drive)

}  // namespace engine
