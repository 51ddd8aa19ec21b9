#include "../vector8.hpp"
#include "tile.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

static_assert(TILE_ROW == 2 * LANES);

VECTOR_INLINE Complex8 load_power(const double* powers, int i, int64_t k) {
    return {load(powers + 2 * i * CHUNK + k), load(powers + (2 * i + 1) * CHUNK + k)};
}

bool turn(double* z, const double* pole, const double* block, const Lanes& lanes, double floor, double* now,
          double* powers) {
    const Double8 floor_squared = broadcast(floor * floor), zero = broadcast(0.0);
    Double8 active = zero;
    for (int64_t k = 0; k < lanes.count; k += LANES) {
        const int64_t re = lanes.start + k, im = re + lanes.modes;
        const Double8 x = load(z + re), y = load(z + im);
        const Double8 squared = x * x + y * y;
        const Complex8 state{where_at_least(squared, floor_squared, x), where_at_least(squared, floor_squared, y)};
        active = active + where_at_least(squared, floor_squared, broadcast(1.0));
        store(now + k, state.re);
        store(now + CHUNK + k, state.im);
        const Complex8 next = state * Complex8{load(block + re), load(block + im)};
        store(z + re, next.re);
        store(z + im, next.im);
        Complex8 p{load(pole + re), load(pole + im)};
        for (int i = 0; i < 5; ++i) {
            store(powers + 2 * i * CHUNK + k, p.re);
            store(powers + (2 * i + 1) * CHUNK + k, p.im);
            p = p * p;
        }
    }
    return total(active) > 0;
}

// p in the lanes whose number has this bit, else 1.
VECTOR_INLINE Complex8 factor(const double* powers, int bit, int64_t k) {
    const double *re = powers + 2 * bit * CHUNK + k, *im = re + CHUNK;
    return {where_bit(bit, broadcast(*re), broadcast(1.0)), where_bit(bit, broadcast(*im), broadcast(0.0))};
}

void rows(const double* powers, int64_t count, double* table) {
    for (int64_t k = 0; k < count; ++k) {
        const Complex8 low = factor(powers, 0, k) * factor(powers, 1, k) * factor(powers, 2, k);
        const Complex8 high = low * Complex8{broadcast(powers[6 * CHUNK + k]), broadcast(powers[7 * CHUNK + k])};
        double* row = table + k * 2 * TILE_ROW;
        store(row, low.re);
        store(row + LANES, high.re);
        store(row + 2 * LANES, low.im);
        store(row + 3 * LANES, high.im);
    }
}

void columns(const double* now, const double* weight, const Lanes& lanes, const double* powers, double* column) {
    for (int64_t k = 0; k < lanes.count; k += LANES) {
        const int64_t re = lanes.start + k;
        const Complex8 s = load_power(powers, 4, k), s2 = s * s, s4 = s2 * s2;
        Complex8 u[4];  // four chains side by side: the latency of one product is hidden by three others
        u[0] = Complex8{load(now + k), load(now + CHUNK + k)} *
               Complex8{load(weight + re), load(weight + re + lanes.modes)};
        u[1] = u[0] * s;
        u[2] = u[0] * s2;
        u[3] = u[1] * s2;
        for (int64_t q = 0; q < TILE_ROWS; q += 4)
            for (int i = 0; i < 4; ++i) {
                store(column + (q + i) * CHUNK + k, u[i].re);
                store(column + (TILE_ROWS + q + i) * CHUNK + k, -u[i].im);
                u[i] = u[i] * s4;
            }
    }
}

constexpr int64_t ROWS_AT_ONCE = PARTS == 1 ? 8 : 2;  // so many sums fit the registers
constexpr int64_t HALVES_AT_ONCE = PARTS == 4 ? 1 : 2;

void outer(const double* column, const double* table, int64_t count, double* sound) {
    for (int64_t q = 0; q < TILE_ROWS; q += ROWS_AT_ONCE)
        for (int64_t half = 0; half < 2; half += HALVES_AT_ONCE) {
            Double8 sum[ROWS_AT_ONCE][HALVES_AT_ONCE];
            double* out = sound + q * TILE_ROW + half * LANES;
            for (int64_t i = 0; i < ROWS_AT_ONCE; ++i)
                for (int64_t h = 0; h < HALVES_AT_ONCE; ++h) sum[i][h] = load(out + i * TILE_ROW + h * LANES);
            for (int64_t k = 0; k < count; ++k) {
                const double* row = table + k * 2 * TILE_ROW + half * LANES;
                const double* u = column + q * CHUNK + k;
                for (int64_t h = 0; h < HALVES_AT_ONCE; ++h) {
                    const Double8 real = load(row + h * LANES), imaginary = load(row + TILE_ROW + h * LANES);
                    for (int64_t i = 0; i < ROWS_AT_ONCE; ++i)
                        sum[i][h] = (sum[i][h] + broadcast(u[i * CHUNK]) * real) +
                                    broadcast(u[(TILE_ROWS + i) * CHUNK]) * imaginary;
                }
            }
            for (int64_t i = 0; i < ROWS_AT_ONCE; ++i)
                for (int64_t h = 0; h < HALVES_AT_ONCE; ++h) store(out + i * TILE_ROW + h * LANES, sum[i][h]);
        }
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Tile, tile) = {VECTOR_LEVEL::turn, VECTOR_LEVEL::rows, VECTOR_LEVEL::columns, VECTOR_LEVEL::outer};

}  // namespace engine
