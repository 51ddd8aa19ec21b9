// Translations of a rigid body: one pole, three axes, forces and cells of pulses in, far pressure out.
//
//     z <- z p + (1 + i d/ω) (e^s - 1)/s · F period + Σ strikes,    dipole = weight Re z
//     force: acts evenly over the sample before its instant; strike: even over the cells of the sample grid,
//         at each sample   j (1 + i d/ω) (D - 1)/(s/c) Σ_i ΔQ_i D^i    over the c cells before it,  D = e^{s/c}
//         (its own impulses, evenly over the cells, as such a mode responds to the slope of a slow force)
//     all forces on a body act as one:   F = Σ ± f (d0 + (d1 - d0) x)
//
// Such a mode (see engine/bank/resonator.py) decays within some ten or hundred samples: it runs sample by sample, and rests
// where it has fallen below the floor at one of every DRIVEN samples of absolute time.
#pragma once

#include "layout.hpp"

namespace engine {

// Divide a strike into cells of the sample grid, which no sample cuts through, and compute a cell's response:
// (1 + i d/ω) (e^{s/cells} - 1)/(s/cells), of an impulse that acts evenly over the cell, at the cell's end.
void enter_cells(BankStrike& strike, const BankBody& body);

// Compute samples at … at + n - 1 of body b's translations into scratch.dipole[b]. False where they rest.
//
// work: its forces are listed (`advance_bank`); stride: of its signal.
bool translate(int64_t at, int64_t n, int64_t b, int64_t stride, const BankTables& bank, const ScratchTables& scratch,
               BankWork& work);

}  // namespace engine
