// Where a contact becomes a force: from pairs' loads and contact rows to the strikes' force pulses on modes.
//
//     Pair: load F - opening of F, over a rising edge -> Strike, with its fraction of up to three steps  load_splitting
//         + rows of these steps -> impulse, normal, lever, approach; what of it has a cause
//         -> Pulse: start, length, impulse, transmitted fraction; and Uᵀj on either body
//
// One pulse's rows of up to three steps, several points each, have one time history, so that the manifold's sum and
// moment, which are all that is reliable, are kept: Uᵀj is summed over the rows, each at its own point with its own
// direction, friction included. Strikes in the order of their pairs' keys, rows of one by step and as they came.
#pragma once

#include "../groups.hpp"
#include "contact_scratch.hpp"

namespace engine {

// Most friction per normal force of a manifold that carries load: a contact that Bullet drops within a step keeps its
// friction.
constexpr double STEEPEST = 10.0;
// Radius, as a fraction of the smaller body's size, of the least area that a nearly flat impact touches.
constexpr double STRUCK_FLAT = 0.02;
// u₀ over rms roughness: 0.4 to 0.5 of self-affine surfaces [Persson 2007; Akarapu, Sharp & Robbins 2011, PRL 106].
constexpr double PERSSON = 0.5;

// Find the strikes that begin in step `number`, `ahead` steps (0 or 1) after the one being rendered.
//
// They are written to scratch.pulse and scratch.modal_impulse from `found` on; returns the new number. Loads that they
// use are marked as used. Call with ahead = 0 first. Pairs that cannot sound (no modes, no moving volume) are skipped,
// and those of which neither moves. A strike of bodies that overlap as the step starts is dated back into the step
// being rendered. window: from the step being rendered to the third after it. strikes: one for each active pair.
int64_t find_pulses(int64_t ahead, int64_t number, int64_t found, const WindowTables& window, const BodyTables& table,
                    const PairTables& pairs, Array<Strike, 1> strikes, const ScratchTables& scratch,
                    ContactScratch& memory);

}  // namespace engine
