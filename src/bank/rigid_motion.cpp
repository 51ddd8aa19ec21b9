#include "rigid_motion.hpp"

namespace engine {

void filter_swing(Array<const double, 1> taps, Array<const double, 1> shape, Array<const double, 2> moved, Doubles past,
                  Doubles swing) {
    for (int64_t n = 0; n < swing.size(); ++n) {
        double x = 0;
        for (int64_t i = 0; i < shape.size(); ++i) x += shape[i] * moved(i, n);
        const double y = taps[0] * x + past[0];
        past[0] = taps[1] * x - taps[3] * y + past[1];
        past[1] = taps[2] * x - taps[4] * y;
        swing[n] = y;
    }
}

}  // namespace engine
