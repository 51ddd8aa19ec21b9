// The level below which a number of the sound means nothing.
#pragma once

namespace engine {

// Samples below this become 0: they have no meaning in pascal or m/s, and their float32 would be subnormal. Gains and
// forces below it, too: no product of theirs becomes subnormal.
constexpr double FLUSH = 1e-30;
constexpr double FLUSH_SQUARED = FLUSH * FLUSH;

inline double flushed(double value) {
    return value * value >= FLUSH_SQUARED ? value : 0.0;
}

}  // namespace engine
