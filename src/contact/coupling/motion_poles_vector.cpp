#include "motion_poles_vector.hpp"

#include <limits>

#include "../../vector8.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

// Eight columns of SUMS sums, which stay in registers.
template <int SUMS>
VECTOR_INLINE void combine_columns(const RowFactors& factors, int64_t count, const double* rows, int64_t n,
                                   double* sums) {
    Double8 total[SUMS];
    for (Double8& one : total) one = spread(0.0);
    const double* factor = factors.first;
    for (int64_t i = 0; i < count; ++i, factor += factors.row) {
        const Double8 row = load(rows + i * n);
#pragma GCC unroll 4
        for (int j = 0; j < SUMS; ++j) total[j] = total[j] + spread(factor[j * factors.sum]) * row;
    }
    for (int j = 0; j < SUMS; ++j) store(sums + j * n, total[j]);
}

template <int SUMS>
VECTOR_INLINE void combine_some(const RowFactors& factors, int64_t count, const double* rows, int64_t n, double* sums) {
    int64_t k = 0;
    for (; k + LANES <= n; k += LANES) combine_columns<SUMS>(factors, count, rows + k, n, sums + k);
    if (k < n && n >= LANES) {  // the last eight, some of them once more
        combine_columns<SUMS>(factors, count, rows + n - LANES, n, sums + n - LANES);
        return;
    }
    for (; k < n; ++k)
        for (int j = 0; j < SUMS; ++j) {
            double total = 0.0;
            for (int64_t i = 0; i < count; ++i)
                total += factors.first[i * factors.row + j * factors.sum] * rows[i * n + k];
            sums[j * n + k] = total;
        }
}

void combine(const RowFactors& factors, int64_t many, int64_t count, const double* rows, int64_t n, double* sums) {
    int64_t j = 0;
    const auto from = [&](int64_t sum) {
        return RowFactors{factors.first + sum * factors.sum, factors.row, factors.sum};
    };
    for (; j + 4 <= many; j += 4) combine_some<4>(from(j), count, rows, n, sums + j * n);
    for (; j < many; ++j) combine_some<1>(from(j), count, rows, n, sums + j * n);
}

void respond(double lam, double loss, const double* __restrict along, const double* __restrict rate,
             const double* __restrict square, int64_t n, const PartnerResponse& response, double* __restrict slope_re,
             double* __restrict slope_im) {
    double* __restrict u = response.u, * __restrict v = response.v;
    double* __restrict y = response.y, * __restrict z = response.z;
    for (int64_t k = 0; k < n; ++k) {
        const double real = lam - square[k], imaginary = loss * rate[k];
        const double size = 1.0 / (real * real + imaginary * imaginary);
        y[k] = real * size, z[k] = -imaginary * size;
        u[k] = along[k] * y[k], v[k] = along[k] * z[k];
        slope_re[k] += u[k] * u[k] - v[k] * v[k];
        slope_im[k] += 2.0 * u[k] * v[k];
    }
}

void hold(double value, const double* __restrict own, const double* __restrict x, const double* __restrict y, int64_t n,
          double* __restrict held_re, double* __restrict held_im) {
    for (int64_t k = 0; k < n; ++k) {  // a motion is 0 apart from itself
        const double apart = value - own[k];
        const double bound = apart * apart + (x[k] * x[k] + y[k] * y[k]);
        const double part = apart / (bound > 0.0 ? bound : 1.0);
        held_re[k] -= (x[k] * x[k] - y[k] * y[k]) * part;
        held_im[k] -= 2.0 * x[k] * y[k] * part;
    }
}

void add_square(double spring, const double* __restrict u, const double* __restrict v, int64_t n,
                double* __restrict held_re, double* __restrict held_im) {
    for (int64_t k = 0; k < n; ++k) {
        held_re[k] += spring * (u[k] * u[k] - v[k] * v[k]);
        held_im[k] += spring * (2.0 * u[k] * v[k]);
    }
}

void share(const bool* __restrict moves, const double* __restrict part, const double* __restrict shift, int64_t n,
           const PartnerResponse& response, double* __restrict size) {
    constexpr double most = std::numeric_limits<double>::max();
    double* __restrict u = response.u, * __restrict v = response.v;
    const double* __restrict y = response.y, * __restrict z = response.z;
    for (int64_t k = 0; k < n; ++k) {
        const double real = 1.0 + shift[k] * y[k] - shift[n + k] * z[k];
        const double imaginary = shift[k] * z[k] + shift[n + k] * y[k];
        const double below = 1.0 / (real * real + imaginary * imaginary);
        const double a = u[k] * part[k] - v[k] * part[n + k], b = u[k] * part[n + k] + v[k] * part[k];
        const double first = (a * real + b * imaginary) * below, second = (b * real - a * imaginary) * below;
        const bool fine = moves[k] && first <= most && first >= -most && second <= most && second >= -most;
        u[k] = fine ? first : 0.0, v[k] = fine ? second : 0.0;
        size[k] += u[k] * u[k] + v[k] * v[k];
    }
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(MotionLoops, motion_loops) = {VECTOR_LEVEL::combine, VECTOR_LEVEL::respond, VECTOR_LEVEL::hold,
                                           VECTOR_LEVEL::add_square, VECTOR_LEVEL::share};

}  // namespace engine
