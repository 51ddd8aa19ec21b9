#include <cmath>
#include <numbers>

#include "surface_waves.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

constexpr float PI = std::numbers::pi_v<float>;
constexpr float ROUNDS = 12582912.0f;  // 1.5·2²³: what is added to it is rounded to whole numbers

// Row of both matrices for triangle j: a loop without calls and branches, for the compiler to run in vectors. Each
// element depends on its own numbers alone, so the bits do not depend on how many run at once.
void matrix_row(float k, float b, const float* __restrict place, const float* __restrict single,
                const float* __restrict dipole, const float* __restrict across, const float* __restrict loop,
                int64_t count, int64_t j, float* __restrict left, float* __restrict right) {
    const float *x = place, *y = place + count, *z = place + 2 * count;
    const float *u = place + 3 * count, *v = place + 4 * count, *w = place + 5 * count;
    const float xj = x[j], yj = y[j], zj = z[j], uj = u[j], vj = v[j], wj = w[j], area = place[6 * count + j];
    constexpr float even = 0.25f / PI;
    for (int64_t i = 0; i < count; ++i) {
        const float r0 = x[i] - xj, r1 = y[i] - yj, r2 = z[i] - zj;
        const float square = r0 * r0 + r1 * r1 + r2 * r2 + 1e-30f, over = 1.0f / std::sqrt(square);
        const float kr = k * square * over;
        const float rx = (r0 * u[i] + r1 * v[i] + r2 * w[i]) * over, ry = -(r0 * uj + r1 * vj + r2 * wj) * over;
        const float both = u[i] * uj + v[i] * vj + w[i] * wj;
        const float turns = kr * (0.5f / PI), t = PI * (turns - ((turns + ROUNDS) - ROUNDS)), s = t * t;
        // sine and cosine of half the angle, |t| ≤ π/2: Taylor to 1e-7
        const float sn =
            t * (1 + s * (-1.f / 6 + s * (1.f / 120 + s * (-1.f / 5040 + s * (1.f / 362880 + s * (-1.f / 39916800))))));
        const float cs =
            1 +
            s * (s * (1.f / 24 + s * (-1.f / 720 + s * (1.f / 40320 + s * (-1.f / 3628800 + s * (1.f / 479001600))))) -
                 0.5f);
        const float sine = 2 * sn * cs, cosine = 1 - 2 * sn * sn;
        const float f_re = (1 - cosine - kr * sine) * over * over, f_im = (sine - kr * cosine) * over * over;
        const float g_re = (cosine * (2 - kr * kr) + 2 * kr * sine - 2) * over * over * over;
        const float g_im = (2 * kr * cosine - sine * (2 - kr * kr)) * over * over * over;
        float d_re = loop[i] + 0.5f * k * k * single[i] * both;
        d_re += area * ((g_re - f_re * over) * rx * ry - (f_re + 0.5f * k * k) * over * both);
        const float d_im = area * ((g_im - f_im * over) * rx * ry - f_im * over * both);
        left[2 * i] = even * (b * d_im - dipole[i] - area * f_re * ry);
        left[2 * i + 1] = -even * (area * f_im * ry + b * d_re);
        right[2 * i] = even * (single[i] + area * (cosine - 1) * over - b * area * f_im * rx);
        right[2 * i + 1] = even * (b * (across[i] + area * f_re * rx) - area * sine * over);
    }
    left[2 * j] = 0.5f - b * (k * k * k) / 3 * area * even;
    left[2 * j + 1] = -b * (loop[j] + 0.5f * k * k * single[j]) * even;
    right[2 * j] = single[j] * even;
    right[2 * j + 1] = -k * area * even + b * (0.5f + across[j] * even);
}

void matrices(float k, float b, Array<const float, 2> place, Array<const float, 3> kernels, Array<float, 3> left,
              Array<float, 3> right) {
    const int64_t count = place.shape[1];
    for (int64_t j = 0; j < count; ++j)
        matrix_row(k, b, place.data, &kernels(0, j, 0), &kernels(1, j, 0), &kernels(2, j, 0), &kernels(3, j, 0), count,
                   j, &left(j, 0, 0), &right(j, 0, 0));
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(SurfaceWaves, surface_waves) = {VECTOR_LEVEL::matrices};

}  // namespace engine
