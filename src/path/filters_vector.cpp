#include "../vector8.hpp"
#include "filters.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

// Samples of ``groups`` groups of eight, whose sums wait for each other's products.
template <int groups>
VECTOR_INLINE void filter_groups(const double* tap, int64_t taps, const double* signal, double* out) {
    Double8 sum[groups];
    for (int g = 0; g < groups; ++g) sum[g] = load(out + g * LANES);
    for (int64_t k = 0; k < taps; ++k) {
        const Double8 weight = broadcast(tap[k]);
        for (int g = 0; g < groups; ++g) sum[g] = sum[g] + weight * load(signal + taps - 1 - k + g * LANES);
    }
    for (int g = 0; g < groups; ++g) store(out + g * LANES, sum[g]);
}

void filter(const double* tap, int64_t taps, const double* signal, double* out, int64_t count) {
    constexpr int many = 3;  // as many sums as registers hold
    int64_t n = 0;
    for (; n + many * LANES <= count; n += many * LANES) filter_groups<many>(tap, taps, signal + n, out + n);
    for (; n + LANES <= count; n += LANES) filter_groups<1>(tap, taps, signal + n, out + n);
    for (; n < count; ++n) {
        double sum = out[n];
        for (int64_t k = 0; k < taps; ++k) sum += tap[k] * signal[taps - 1 - k + n];
        out[n] = sum;
    }
}

void add_scaled(const double* signal, double gain, double slope, double* out, int64_t count) {
    static const double number[LANES] = {0, 1, 2, 3, 4, 5, 6, 7};
    const Double8 begin = broadcast(gain), rise = broadcast(slope);
    int64_t n = 0;
    for (; n + LANES <= count; n += LANES) {
        const Double8 place = broadcast(static_cast<double>(n)) + load(number);
        store(out + n, load(out + n) + load(signal + n) * (begin + rise * place));
    }
    for (; n < count; ++n) out[n] += signal[n] * (gain + slope * static_cast<double>(n));
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Filters, filters) = {VECTOR_LEVEL::filter, VECTOR_LEVEL::add_scaled};

}  // namespace engine
