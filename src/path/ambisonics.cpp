#include "ambisonics.hpp"

#include <algorithm>
#include <cmath>

#include "filters.hpp"

namespace engine {

void spherical_harmonics(double x, double y, double z, int64_t order, double* out) {
    const double length = std::sqrt(x * x + y * y + z * z), inverse = length > 1e-9 ? 1 / length : 0;
    x *= inverse, y *= inverse, z *= inverse;
    out[0] = 1, out[1] = y, out[2] = z, out[3] = x;
    if (order > 1) {
        const double one = inverse > 0 ? 1 : 0;
        out[4] = std::sqrt(3.0) * x * y, out[5] = std::sqrt(3.0) * y * z;
        out[6] = 0.5 * (3 * z * z - one), out[7] = std::sqrt(3.0) * x * z;
        out[8] = std::sqrt(0.75) * (x * x - y * y);
    }
    if (order > 2) {
        out[9] = std::sqrt(0.625) * y * (3 * x * x - y * y), out[10] = std::sqrt(15.0) * x * y * z;
        out[11] = std::sqrt(0.375) * y * (5 * z * z - 1), out[12] = 0.5 * z * (5 * z * z - 3);
        out[13] = std::sqrt(0.375) * x * (5 * z * z - 1), out[14] = std::sqrt(3.75) * z * (x * x - y * y);
        out[15] = std::sqrt(0.625) * x * (x * x - 3 * y * y);
    }
}

void encode_ambisonics(Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
                       Array<const double, 2> pressure, Array<const double, 3> away, int64_t order,
                       Array<double, 3> out, bool apart) {
    // samples: a body that passes at 10 m/s in 0.2 m moves by 2°, and a straight line misses Y of order 3 by 1e-3
    constexpr int64_t piece = 32;
    const int64_t channels = (order + 1) * (order + 1);
    double begin[MOST_CHANNELS], end[MOST_CHANNELS];
    for (int64_t k = 0; k < first.size(); ++k) {
        const int64_t stop = first[k] + count[k];
        for (int64_t b = 0; b < pressure.shape[0]; ++b) {
            const double* sent = pressure[b].data;
            if (std::all_of(sent + first[k], sent + stop, [](double p) { return p == 0; })) continue;
            const double *u = &away(k, b, 0), *v = &away(k + 1, b, 0);
            const auto directed = [&](double s, double* harmonics) {
                spherical_harmonics(u[0] + s * (v[0] - u[0]), u[1] + s * (v[1] - u[1]), u[2] + s * (v[2] - u[2]), order,
                                    harmonics);
            };
            for (int64_t at = first[k]; at < stop;) {
                const int64_t n = std::min(piece, stop - at);
                directed(along[at], begin);
                directed(at + n < stop ? along[at + n] : 1, end);
                for (int64_t i = 0; i < channels; ++i)
                    filters().add_scaled(sent + at, begin[i], (end[i] - begin[i]) / static_cast<double>(n),
                                         &out(apart ? b : 0, i, at), n);
                at += n;
            }
        }
    }
}

}  // namespace engine
