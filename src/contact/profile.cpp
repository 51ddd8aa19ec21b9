#include "profile.hpp"

#include <cmath>
#include <numbers>

#include "profile_vector.hpp"

namespace engine {

void gained_heights(const Octaves& height_m, double speed_m_s, const Patch& patch, double sr, Octaves& gained_m) {
    constexpr double slowest_hz = 8.0, pi = std::numbers::pi;
    for (int j = 0; j < OCTAVES; ++j) {
        const double f = speed_m_s / WAVE_M[j];
        double fine = (0.4 - f / sr) / 0.2, slow = f / slowest_hz - 1.0;
        fine = fine < 0.0 ? 0.0 : fine, slow = slow < 0.0 ? 0.0 : slow;
        fine = fine > 1.0 ? 1.0 : fine, slow = slow > 1.0 ? 1.0 : slow;
        double height = height_m[j];
        if (patch.ball_m > 0.0) {
            const double most = reach_of_ball(WAVE_M[j], patch.radius_m, patch.ball_m);
            height = height > most ? most : height;
        }
        gained_m[j] = height * (fine * slow / std::sqrt(1.0 + patch.radius_m / WAVE_M[j]));
        if (patch.touching > 0.0) {
            const double turn = 2.0 * pi * patch.radius_m / WAVE_M[j];
            const double smooth = height * (fine * slow / std::sqrt(1.0 + 0.25 * pi * (turn * turn * turn)));
            gained_m[j] += patch.touching * (smooth - gained_m[j]);
        }
    }
}

// Coefficients of a lattice: the first one's number is even, the last one's odd.
struct LatticeSpan {
    int64_t first, last;
};

// Return the coefficients, some octaves coarser, that others are computed from.
static LatticeSpan coarser(LatticeSpan points, int halvings) {
    for (; halvings > 0; --halvings) points = {((points.first >> 1) - 1) & -2, ((points.last >> 1) + 1) | 1};
    return points;
}

double sweep_profile(double swept_m, const double (&speed_m_s)[2], Array<const double, 1> x,
                     const RoughSurface& surface, const double (&height_m)[2][OCTAVES], double per_sample_s,
                     double* rate_m_s, std::vector<double>& lattice) {
    if (x.size() == 0) return swept_m;
    const int64_t n = x.size(), whole = (n + LANES - 1) & -LANES;
    const double growth_m_s = speed_m_s[1] - speed_m_s[0];
    const auto sounds = [&](int j) { return height_m[0][j] != 0.0 || height_m[1][j] != 0.0; };
    if (static_cast<int64_t>(lattice.size()) < 2 * whole) lattice.resize(2 * whole);
    for (int64_t i = 0; i < n; ++i) {
        lattice[whole + i] = x[i];
        swept_m += (speed_m_s[0] + growth_m_s * x[i]) * per_sample_s;
        lattice[i] = swept_m;
    }
    for (int64_t i = n; i < whole; ++i) lattice[whole + i] = x[n - 1], lattice[i] = swept_m;
    int finest = OCTAVES - 1, coarsest = 0;
    while (finest >= 0 && !sounds(finest)) --finest;
    if (finest < 0) return swept_m;
    while (!sounds(coarsest)) ++coarsest;
    const double per_m =
        static_cast<double>(1 << finest) / (LONGEST_WAVE_M * OCTAVE_LATTICE) * (1.0 + surface.around.stretch);
    const LatticeSpan points{(static_cast<int64_t>(lattice[0] * per_m) - 1) & -2,
                             (static_cast<int64_t>(swept_m * per_m) + 2) | 1};
    const int64_t size = points.last - points.first + 1 + 4 * LANES;  // with room for values written beyond the end
    if (static_cast<int64_t>(lattice.size()) < 2 * whole + 4 * size) lattice.resize(2 * whole + 4 * size);
    const double *place_m = lattice.data(), *fraction = place_m + whole;
    double* memory = lattice.data() + 2 * whole;
    double* now[2] = {memory, memory + size};  // coefficients at the step's start and their growth until its end
    double* next[2] = {memory + 2 * size, memory + 3 * size};
    // neighbouring seeds must start far apart in the 2^32 values of the mix
    const auto seed = static_cast<uint32_t>((static_cast<uint64_t>(surface.seed) * 0x9E3779B97F4A7C15u) >> 33);
    const LatticeSpan above = coarser(points, finest - coarsest + 1);
    for (int64_t i = 0; i <= above.last - above.first; ++i) now[0][i] = now[1][i] = 0.0;
    int64_t begin = above.first;
    for (int j = coarsest; j <= finest; ++j) {
        const auto [first, last] = coarser(points, finest - j);
        const int64_t from = (first >> 1) - begin - 1;
        const Refinement octave{(last - first + 1) >> 1,
                                seed + 0x3C6EF372u * static_cast<uint32_t>(j),
                                static_cast<uint32_t>(first),
                                surface.around.points * static_cast<double>(1 << j),
                                {height_m[0][j], height_m[1][j] - height_m[0][j]}};
        const double* const coarse[2] = {now[0] + from, now[1] + from};
        profile_vector().refine(octave, coarse, next);
        for (int end = 0; end < 2; ++end) std::swap(now[end], next[end]);
        begin = first;
    }
    // never below 0: a place less its origin then has no more digits than the place, and is exact
    const int64_t origin = begin >= 0 ? begin + 1 : 0;
    const double* const read[2] = {now[0] + (origin - begin - 1), now[1] + (origin - begin - 1)};
    profile_vector().read({static_cast<double>(origin), per_m, speed_m_s[0], growth_m_s, whole}, place_m, fraction,
                          read, rate_m_s);
    return swept_m;
}

}  // namespace engine
