// The modal bank: a step's pulses and forces in, samples of all bodies out.
//
//     block start:  tile[n] = Σ Re(w z p^n),  z <- z p^256         all modes of a ringing body at once (tile)
//     32 samples:   f <- f p + (strikes + forces) (1 + i d/ω),  y = tile[n] + Σ Re(w f)     driven bodies only (drive)
//     block end:    z <- z + f p,  f <- 0
//     lasting:      to sets of pressure driven bodies also send -f Re(w (1 + i d/ω)/(1 - p)) of their forces, and as
//                   much of their strikes: what a force that lasts would send by its modes. A body at rest that is
//                   pressed is silent; where ω is far below the rate this is Im(w) f/ω, and all of them together send
//                   Im(w) (q̈ + d q̇)/ω in place of -Im(w) (ω² + d²) q/ω
//     bent bodies:  p of each block by |z| at its start, and of what is driven within it every 32 samples
//
// Blocks lie on a fixed grid of absolute samples, and f runs sample by sample: where a frame ends changes nothing. New
// poles of a body take effect where one of the 32 begins (pole) or a block (block, too): see `poles`.
#pragma once

#include "layout.hpp"

namespace engine {

// Compute samples at … at + n - 1 into scratch: source (W, b, n or more) and dipole (b, 3, n or more).
//
// progress (n,): where between its gains each sample of a drive lies. scratch.sounds: on entry it must hold for the
// rows transmitted in; rows that stay silent are cleared only where it is 1. Makes room in work where it is too small.
void advance_bank(int64_t at, int64_t n, double sr, Array<const double, 1> progress, const BankTables& bank,
                  const ScratchTables& scratch, BankWork& work);

}  // namespace engine
