// Mode shapes: rounded to whole multiples of a power of two, one for each mode (sonic_bullet/records/mode_shapes.py
// says why), and their largest motion.
//
//     q = round(φ / 2^e),   2^e = 2^(E − B),   2^(E−1) <= max |φ| < 2^E over the mode;     φ := q·2^e
#pragma once

#include "../array.hpp"

namespace engine {

// Round shapes (n, m), of n components, in place to ``bits`` B; what is not finite stays as it is.
void round_shapes(Array<float, 2> shape, int bits);

// Fill largest (m,), the largest |φ| over the vertices, of shapes (v, 3, m).
void find_largest_motions(Array<const float, 3> shape, Doubles largest);

}  // namespace engine
