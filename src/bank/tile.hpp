// Free ringing of a chunk of modes over one block of 256 samples, as vector instructions.
//
//     y[16 q + r] = Σ_modes Re(u p^(16 q) p^r) = Σ Re(u s^q)·Re(p^r) - Im(u s^q)·Im(p^r),    u = w z,  s = p^16,
//         q, r in 0 … 15
//
// It is an outer product of two short geometric rows per mode: two products and two sums a sample, accumulators in
// registers. All sums have a fixed order, so the bits are the same at every level. A body's modes fill whole groups of
// eight lanes (spare lanes are zero).
#pragma once

#include "../vector_level.hpp"
#include "layout.hpp"

namespace engine {

// Lanes start … start + count - 1, count whole eights, of flat arrays with ``modes`` real parts, then as many imaginary
// ones.
struct Lanes {
    int64_t modes;
    int64_t start;
    int64_t count;
};

struct Tile {
    // Take the state at a block's start: now = z (0 where |z|² < floor), z <- now·p^256, powers = p, p², p⁴, p⁸, p¹⁶.
    // Returns whether any lane is active. now (2·CHUNK,), powers (10·CHUNK,).
    bool (*turn)(double* z, const double* pole, const double* block, const Lanes& lanes, double floor, double* now,
                 double* powers);
    // Fill table (CHUNK, 2·TILE_ROW) with Re p^r, then Im p^r, r = 0 … 15, of each of ``count`` modes: p^r is the
    // product of p, p², p⁴, p⁸ where r has that bit.
    void (*rows)(const double* powers, int64_t count, double* table);
    // Fill column (2·TILE_ROWS, CHUNK) with Re u s^q, then -Im u s^q, q = 0 … 15, u = weight·now. weight: flat (2·m,).
    void (*columns)(const double* now, const double* weight, const Lanes& lanes, const double* powers, double* column);
    // Add Σ over ``count`` modes of column ⊗ table to sound (BLOCK,), mode after mode.
    void (*outer)(const double* column, const double* table, int64_t count, double* sound);
};
CHOOSE_VECTOR(Tile, tile)

}  // namespace engine
