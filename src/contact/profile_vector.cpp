#include "profile_vector.hpp"

#include "../vector8_compare.hpp"

namespace engine {
namespace VECTOR_LEVEL {

constexpr int PART_LANES = LANES / PARTS;
typedef int32_t WholePart __attribute__((vector_size(4 * PART_LANES)));
typedef uint32_t MixPart __attribute__((vector_size(4 * PART_LANES)));

// Compute the noise of eight lattice points, on ±1, from those numbered `first`.
static VECTOR_INLINE Double8 noise(const Refinement& octave, uint32_t first) {
    Double8 out;
    for (int i = 0; i < PARTS; ++i) {
        MixPart h;
        for (int lane = 0; lane < PART_LANES; ++lane) h[lane] = first + static_cast<uint32_t>(PART_LANES * i + lane);
        if (octave.around > 0.0)
            for (int lane = 0; lane < PART_LANES; ++lane) {
                const double point = static_cast<int32_t>(h[lane]);
                const double turns = std::floor((point + 0.5) * (1.0 / octave.around));
                h[lane] = static_cast<uint32_t>(static_cast<int32_t>(point - turns * octave.around));
            }
        h += octave.name;
        h = (h ^ (h >> 16)) * 0x7FEB352Du;
        h = (h ^ (h >> 15)) * 0x846CA68Bu;
        h ^= h >> 16;
        WholePart signed_h;
        std::memcpy(&signed_h, &h, sizeof h);
        out.part[i] = __builtin_convertvector(signed_h, Part) * (1.0 / 2147483648.0);
    }
    return out;
}

// Put eight even and eight odd points in order.
static VECTOR_INLINE void store_alternating(const Double8& even, const Double8& odd, double* out) {
    double pair[2][LANES];
    store(pair[0], even), store(pair[1], odd);
    for (int lane = 0; lane < LANES; ++lane) out[2 * lane] = pair[0][lane], out[2 * lane + 1] = pair[1][lane];
}

static void refine(const Refinement& octave, const double* const coarse[2], double* const fine[2]) {
    for (int64_t i = 0; i < octave.pairs; i += LANES) {
        const uint32_t first = octave.first + static_cast<uint32_t>(2 * i);
        const Double8 own[2] = {noise(octave, first), noise(octave, first + LANES)};
        for (int end = 0; end < 2; ++end) {
            const double* from = coarse[end] + i;
            const Double8 a = load(from), b = load(from + 1), c = load(from + 2);
            const Double8 even = broadcast(0.125) * (a + broadcast(6.0) * b + c), odd = broadcast(0.5) * (b + c);
            double* to = fine[end] + 2 * i;
            store_alternating(even, odd, to);
            const Double8 height = broadcast(octave.height_m[end]);
            for (int half = 0; half < 2; ++half) store(to + LANES * half, load(to + LANES * half) + height * own[half]);
        }
    }
}

static void read(const Reading& reading, const double* place_m, const double* x, const double* const coefficient[2],
                 double* rate_m_s) {
    const Double8 half = broadcast(0.5), one = broadcast(1.0), per_m = broadcast(reading.per_m);
    const Double8 origin = broadcast(reading.origin);
    for (int64_t i = 0; i < reading.count; i += LANES) {
        const Double8 fraction = load(x + i), u = load(place_m + i) * per_m - origin;
        double place[LANES], weight[LANES], within[LANES], p[4][LANES];
        store(place, u), store(weight, fraction);
        for (int lane = 0; lane < LANES; ++lane) {
            const int64_t cell = static_cast<int32_t>(place[lane]);
            within[lane] = place[lane] - static_cast<double>(cell);
            const double *now = coefficient[0] + cell, *growth = coefficient[1] + cell;
            for (int k = 0; k < 4; ++k) p[k][lane] = now[k] + weight[lane] * growth[k];
        }
        const Double8 t = load(within), s = one - t;
        const Double8 p1 = load(p[1]), p2 = load(p[2]);
        const Double8 d0 = p1 - load(p[0]), d1 = p2 - p1, d2 = load(p[3]) - p2;
        const Double8 slope = half * s * s * d0 + (t * s + half) * d1 + half * t * t * d2;
        const Double8 pace = broadcast(reading.speed_m_s) + broadcast(reading.growth_m_s) * fraction;
        store(rate_m_s + i, load(rate_m_s + i) + slope * per_m * pace);
    }
}

}  // namespace VECTOR_LEVEL

VECTOR_TABLE(ProfileVector, profile_vector) = {VECTOR_LEVEL::refine, VECTOR_LEVEL::read};

}  // namespace engine
