// Contact patches: points tracked and loads smoothed, without the flicker of a simulator's points.
//
//     rows of the step being rendered, load less strikes -> each row to the tracked point near it, or a new one
//         -> n += a (load of its rows − n),   a = 1 − e^{−dt/30 ms}
//         -> ContactPatch: up to PATCH_POINTS points a pair, sum and moment those of the rows, smoothed
//     sets or loads that differ from those of the present poles -> SupportState.stale of both bodies
//
// A resting box shows two, three or four of its corners, another choice each step; sum and moment alone are right. Each
// point keeps the mean of the loads of its rows, so sum and moment of the tracked points are the smoothed ones exactly,
// and the set changes only where a point was not loaded for long, or lies elsewhere. A box that slides keeps its own
// corners as its points; that they lie elsewhere on the board makes its poles stale.
#pragma once

#include "../groups.hpp"
#include "contact_scratch.hpp"

namespace engine {

constexpr int PATCH_POINTS = 4;       // of a pair: a solver of convex shapes gives no more at a time
constexpr double LEAST_PATCH = 0.02;  // fraction of a pair's load below which a point is dropped
constexpr double SAVED_S = 0.0075;    // most time for new poles that is saved up for when many come to rest

// What the support states need to know of the bank, a body each and its lanes: see bank.
struct RingingModes {
    const BankBody* body;
    const Ringing* ringing;
    const double* law;  // (7, lanes); row 6: newtons per unit of z over the load, where the mode separates first
    int64_t lanes;
    const double* z;  // (2·lanes,): real parts first
    const double* driven;
};

// Advance the contact patches of all pairs by a step. A patch without rows for SPAN steps is released.
void track_contact_patches(const Window& here, Array<const ContactRow, 1> rows, const BodyTables& table,
                           const PairTables& pairs, Array<SupportState, 1> support_state);

// Count the steps in which ringing may cause contact separation: Σ_k law[6, k] |z_k| > 1.
// No step is missed, and some are counted in which modes separate at different points.
void count_separations(Array<SupportState, 1> support_state, const RingingModes& modes);

// Mark as wanted the bodies whose poles are to be computed before this step rings; return their number.
// Silent bodies wait.
int64_t choose_bodies(double dt_s, const BodyTables& table, const PairTables& pairs, const SupportTables& supports,
                      const Ringing* ringing, const ScratchTables& scratch, ContactScratch& memory);

}  // namespace engine
