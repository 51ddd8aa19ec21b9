#include "ear_filters.hpp"

#include <algorithm>

#include "filters.hpp"

namespace engine {

void filter_ears(Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
                 Array<const double, 2> pressure, Array<double, 2> past, Array<const double, 4> response,
                 Array<double, 3> out, bool apart, Array<double, 1> scratch) {
    constexpr int64_t block = 256;  // samples at once
    const int64_t taps = response.shape[3], total = pressure.shape[1];
    double* whole = scratch.data;
    double start[block], stop[block];
    for (int64_t b = 0; b < pressure.shape[0]; ++b) {
        std::copy_n(past[b].data, taps - 1, whole);
        std::copy_n(pressure[b].data, total, whole + taps - 1);
        std::copy_n(whole + total, taps - 1, past[b].data);
        if (std::all_of(whole, whole + taps - 1 + total, [](double p) { return p == 0; })) continue;
        for (int64_t k = 0; k < first.size(); ++k) {
            const double *here = &response(k, b, 0, 0), *there = &response(k + 1, b, 0, 0);  // both ears'
            const bool same = std::equal(here, here + 2 * taps, there);
            for (int64_t low = 0; low < count[k]; low += block) {
                const int64_t at = first[k] + low, n = std::min(block, count[k] - low);
                for (int ear = 0; ear < 2; ++ear) {
                    double* heard = &out(apart ? b : 0, ear, at);
                    set_zero(start, n);
                    filters().filter(here + ear * taps, taps, whole + at, start, n);
                    if (!same) {
                        set_zero(stop, n);
                        filters().filter(there + ear * taps, taps, whole + at, stop, n);
                        for (int64_t j = 0; j < n; ++j) start[j] += along[at + j] * (stop[j] - start[j]);
                    }
                    for (int64_t j = 0; j < n; ++j) heard[j] += start[j];
                }
            }
        }
    }
}

}  // namespace engine
