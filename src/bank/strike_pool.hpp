// Strikes under way: a pool of rows, each a force pulse on one body until the last of it has acted.
//
//     modes: nodes u_j = u_0 + jδ, impulses J_j = F(u_j)/Σ F:   at each sample n the driven state gains
//         r_n Σ J_j D^(last - j)   over the nodes in (n-1, n]
//         D = e^{sδ},   r_n = g (1 + i d/ω) e^{s(n - u_last)},   r_{n+1} = r_n e^{s(1 - kδ)},
//             k = nodes in (n, n+1] = 1/δ
//         the middles of cells of the sample grid: at a sample all of the pulse has acted that is over, and no more, so
//         that what is slow moves a fast mode by its slope alone:   Σ_k e^{iωδ(k + 1/2)} = i/(2 sin(ωδ/2)), no real
//         part; so each mode needs four phasors (r, D and the two turns of r), computed once, and no exponential at
//         run time
//     translations: `translation`
//
// Impulses are evaluated as they fall due, from the pulse's own shape; only their sum is known before. Times in
// samples, s per sample. A body's strikes are linked in order of their start, then of arrival: which ends first changes
// no sum.
#pragma once

#include "layout.hpp"

namespace engine {

constexpr int64_t NODES_PER_PULSE = 24;
constexpr int64_t NODES_PER_SAMPLE = 2;
constexpr double SHORTEST_PULSE = 1e-12;  // samples; shorter pulses get this length

// One pulse on one body.
struct BodyPulse {
    double start;        // absolute, in samples
    double length;       // in samples
    bool flat;           // a half-sine, not Hertz'
    double fraction;     // factor of gain and impulse
    const double* gain;  // (columns,) φᵀĵ of the body's modes in N·s/√kg, whole groups of LANE_PAIR (spare ones finite)
    double impulse_n_s[3];  // world
};

// Enter a pulse on body b, which starts after sample ``at`` - 1/2: false where the pool is full (nothing has changed).
bool enter_strike(int64_t b, const BodyPulse& pulse, int64_t at, const BankTables& bank);

// Enter the first scratch.count[0] pulses of a step on both bodies of each, in order; return how many, fewer where the
// pool is full.
//
// begin_s, after_s: start of the rendered step and of the one after it, absolute: pulses found ahead count from there.
// at: the next sample.
int64_t enter_pulses(double begin_s, double after_s, int64_t at, double sr, const BankTables& bank,
                     const ScratchTables& scratch);

// Free the rows of body b's strikes that have acted.
void release_done_strikes(int64_t b, const BankTables& bank);

// Test whether a strike on the modes of body b sounds before sample ``end``.
bool has_nodes_before(int64_t b, int64_t end, const BankTables& bank);

// Add to out (stretch.count,) what the body's strikes send beside its modes, see `lasting` in bank.hpp: each as its
// pulse goes, the mean over a sample about each instant. weight: of the body's first lane.
void send_strikes(int64_t b, const Stretch& stretch, const double* weight, const BankTables& bank, double* out);

// Samples of a stretch at which a strike acts: first … stop - 1.
struct NodeSpan {
    int64_t first;
    int64_t stop;
};

// Plan which nodes of a strike act at the samples at … at + count - 1: plan (count,), and due: impulses, node after
// node. final: the strike advances.
NodeSpan plan_nodes(int64_t slot, int64_t at, int64_t count, const BankTables& bank, NodePlan* plan, double* due,
                    bool final);

}  // namespace engine
