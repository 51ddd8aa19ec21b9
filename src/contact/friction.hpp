// Rolling and sliding of one physics step: from support loads and sweep speeds to forces on modes at audio rate.
//
//     Pair.support_n, rows of the next step -> loads and speeds at both ends -> contact_oscillator: f - N per voice
//         -> drives (Uᵀ on either body's columns and direction, per newton, at the step's start and end)
//
// A step starts with what the step before ended with (loads, speeds, gains, direction are carried in Pair and in the
// gains), so nothing jumps at the step rate. A manifold's points flicker from step to step; the gains follow them with
// a time constant of FOLLOW_S. A pair has a contact oscillator, its voice (Pair.rubs), while its support lasts. It
// begins at rest under its load; its sweep grows from 0 within its first step. Were the load to grow with the sweep, the
// crests would throw the bodies apart before it is there, and it would bring them down harder than ever after.
// One that neither sweeps nor oscillates costs nothing: no force, no gains, no search of triangles.
#pragma once

#include "../groups.hpp"
#include "contact_scratch.hpp"

namespace engine {

constexpr double FOLLOW_S = 0.02;
// Slower sweeps make nothing audible: even waves of 10 µm pass at 20 Hz. Solvers let bodies at rest creep about as
// fast.
constexpr double SWEEP_FLOOR_M_S = 2e-4;

// Compute the force signals of step `number`, a drive each, and write how many into scratch.count[1].
//
// window: with the step that follows. pairs: support_n of this step filled in. x (n,): position of each sample in the
// step, 0 … 1. sr in Hz. voices: one for each active pair; scratch has room for as many drives. Written of each drive:
// scratch.force (d, n) in newton, on the lower body along the direction, its negative on the higher; gain0, gain1: Uᵀ
// on both bodies' columns a newton at the step's ends, linear between; direction0, direction1; body, slot.
void advance_friction(int64_t number, Array<const double, 1> x, double sr, const WindowTables& window,
                      const BodyTables& table, const PairTables& pairs, Array<Voice, 1> voices,
                      const ScratchTables& scratch, ContactScratch& memory);

}  // namespace engine
