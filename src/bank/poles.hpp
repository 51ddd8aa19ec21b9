// Changing poles: of bodies whose contacts change (take_coming), of level-dependent modes (bend_poles).
//
//     coming (8, m): d and ω a sample, d/ω, e^s and e^{256 s}, separation -> law, pole, block at the next block's start
//
// Block starts lie on the grid of absolute time: any split into calls gives the same bits. ½|z|² is a mode's energy
// whatever its pole is, and z continues as it is: no change of poles adds energy or causes a jump.
#pragma once

#include "../math/elementary.hpp"
#include "layout.hpp"

namespace engine {

// Set other poles of body b from the next block's start, at once where nothing of it is active.
//
// step (columns,): s = (-d + iω)/sr of its modes. separation (columns,): fraction of a contact's load that a modal
// velocity of 1 removes; (0,): none. free_law (6, m): the poles without contacts, of all bodies (`instrument.Bank`).
void set_poles(int64_t b, Array<const Complex, 1> step, Array<const double, 1> separation,
               Array<const double, 2> free_law, const BankTables& bank);

// Take the poles that were to come at the begin of body b's block.
void take_coming(int64_t b, const BankTables& bank);

// Compute the poles of body b, bent by level, for the ``span`` samples to come: means over the unforced decay.
//
// a = |z|:  ȧ = −d a (1 + (ca)^p)  ->  a(T)/a = ((1 + (ca)^p) e^{pdT} − (ca)^p)^{−1/p};   ω <- ω (1 + b ⟨a²⟩),
//     ⟨a²⟩ = a² (1 − e^{−2d'T})/2d'T
// (Nayfeh & Mook 1979, eq. 2.3.35 and section 3.3), d' the block's mean decay; exact in amplitude, and in phase for
// c = 0.
void bend_poles(int64_t b, int64_t span, const BankTables& bank);

}  // namespace engine
