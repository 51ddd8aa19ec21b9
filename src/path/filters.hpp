// Filters and gains that run along a signal, eight samples at a time; each sample's sum has the order of the taps,
// however long the block.
#pragma once

#include "../array.hpp"
#include "../vector_level.hpp"

namespace engine {

struct Filters {
    // Add Σ_k tap[k] · signal[t - 1 - k + n], k rising, to out[n], n < count. signal (t - 1 + count,): what came
    // before, then the block.
    void (*filter)(const double* tap, int64_t taps, const double* signal, double* out, int64_t count);
    // Add signal[n] · (gain + slope · n) to out[n], n < count.
    void (*add_scaled)(const double* signal, double gain, double slope, double* out, int64_t count);
};
CHOOSE_VECTOR(Filters, filters)

// Add to out (g, n) what taps (t,) make of signal (g, t - 1 + n).
void filter_rows(Array<const double, 1> taps, Array<const double, 2> signal, Array<double, 2> out);

}  // namespace engine
