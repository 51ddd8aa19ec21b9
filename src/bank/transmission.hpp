// Transmission: modes of one body that sound at another that it touches.
//
//     transmissions (b, J): up to J partners of each body;  set j·W + w of weights at the lanes of body b:
//         y[w, to, n] += ramp[n] Σ Re(weight z[n])
//
// A mode of coupled bodies moves all of them. Its shape on the others is the weight here, its pole the coupled one
// (`poles`), so a transmission has no memory of its own. It begins and ends where a block of absolute time does, fading
// in over its first block and out over its last: nothing jumps, and any split into calls gives the same bits.
#pragma once

#include "../math/elementary.hpp"
#include "layout.hpp"

namespace engine {

// States of a transmission.
namespace phase {
constexpr int64_t OFF = 0;
constexpr int64_t STEADY = 1;
constexpr int64_t COMING = 2;  // from the next block on rising
constexpr int64_t RISING = 3;
constexpr int64_t LEAVING = 4;  // from the next block on falling
constexpr int64_t FALLING = 5;
constexpr int64_t BRIEF = 6;  // rises and is to fall
}  // namespace phase

inline bool is_active(const Transmission& transmission) {
    return transmission.phase != phase::OFF && transmission.phase != phase::COMING;
}

// End what body b transmits, from the next block's start on; at once where nothing of it is active.
void end_transmissions(int64_t b, const BankTables& bank);

// Begin to transmit from body b to another at the next block's start, at once where nothing of it is active: weights of
// its columns, (W, columns). False where no place is free.
bool begin_transmission(int64_t b, int64_t to, Array<const Complex, 2> weight, const BankTables& bank);

// Advance the transmissions of body b at the begin of its block.
void move_transmissions_on(int64_t b, const BankTables& bank);

// Return the last set of weights that reads body b; 0 where none does.
int64_t last_weight_set(int64_t b, const BankTables& bank);

// Add the values of a stretch of body b's j-th transmission, set w, to its partner.
void transmit(int64_t b, int64_t j, int64_t w, const Stretch& stretch, const double* values, const BankTables& bank,
              Array<double, 3> transmitted);

// Add what was transmitted to the bodies' own sound; their rows of scratch.sounds become 1.
void add_transmitted(int64_t n, const BankTables& bank, const ScratchTables& scratch);

}  // namespace engine
