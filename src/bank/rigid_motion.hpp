// Rigid motions that springs hold, of free ones: s²/(s² + 2ds + ω²), as engine/bank/rigid_motion.py says.
#pragma once

#include "../array.hpp"

namespace engine {

// Filter Σ shape (6,) moved (6, n) by taps b0, b1, b2, a1, a2 into swing (n,); past (2,): of the samples before,
// changed.
void filter_swing(Array<const double, 1> taps, Array<const double, 1> shape, Array<const double, 2> moved, Doubles past,
                  Doubles swing);

}  // namespace engine
