#include <numbers>

#include "../vector8.hpp"
#include "far_field.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

constexpr double PI = std::numbers::pi;
constexpr double ROUNDS = 6755399441055744.0;  // 1.5·2⁵²: what is added to it is rounded to whole numbers

// Sums over the patches of a mode in one direction: of v, r̂·Re, r̂·Im, each times cosine and sine.
struct PatchSums {
    Double8 v[2], lever[2], late[2];
};

// Add eight patches. half: k/2π; row (10): v, three of Re, three of Im, three of the place.
VECTOR_INLINE void add_patches(const double* const (&row)[10], int64_t s, const Double8& half,
                               const Double8 (&along)[3], PatchSums& sums) {
    const Double8 turns =
        half * (load(row[7] + s) * along[0] + load(row[8] + s) * along[1] + load(row[9] + s) * along[2]);
    const Double8 t = broadcast(PI) * (turns - ((turns + broadcast(ROUNDS)) - broadcast(ROUNDS))), u = t * t;
    // sine and cosine of half the angle, |t| ≤ π/2: Taylor to 1e-9
    constexpr double odd[] = {1. / 6227020800, -1. / 39916800, 1. / 362880, -1. / 5040, 1. / 120, -1. / 6, 1};
    constexpr double even[] = {-1. / 87178291200, 1. / 479001600, -1. / 3628800, 1. / 40320,
                               -1. / 720,         1. / 24,        -1. / 2,       1};
    Double8 sn = broadcast(odd[0]), cs = broadcast(even[0]);
#pragma GCC unroll 8
    for (int i = 1; i < 7; ++i) sn = sn * u + broadcast(odd[i]);
#pragma GCC unroll 8
    for (int i = 1; i < 8; ++i) cs = cs * u + broadcast(even[i]);
    sn = sn * t;
    const Double8 twice = sn + sn, sine = twice * cs, cosine = broadcast(1.0) - twice * sn;
    const Double8 v = load(row[0] + s);
    const Double8 lever = load(row[1] + s) * along[0] + load(row[2] + s) * along[1] + load(row[3] + s) * along[2];
    const Double8 late = load(row[4] + s) * along[0] + load(row[5] + s) * along[1] + load(row[6] + s) * along[2];
    sums.v[0] = sums.v[0] + v * cosine, sums.v[1] = sums.v[1] + v * sine;
    sums.lever[0] = sums.lever[0] + lever * cosine, sums.lever[1] = sums.lever[1] + lever * sine;
    sums.late[0] = sums.late[0] + late * cosine, sums.late[1] = sums.late[1] + late * sine;
}

void sum_patches(Array<const double, 1> k, Array<const double, 3> moment, Array<const double, 2> place,
                 Array<const double, 2> direction, Array<double, 3> ahead, Array<double, 3> behind) {
    const int64_t count = place.shape[1], whole = count & -LANES;
    for (int64_t i = 0; i < k.size(); ++i) {
        const double* row[10];
        double rest[10][LANES] = {};  // what does not fill eight
        const double* rest_row[10];
        for (int r = 0; r < 10; ++r) {
            row[r] = r < 7 ? moment[i][r].data : place[r - 7].data;
            for (int64_t s = whole; s < count; ++s) rest[r][s - whole] = row[r][s];
            rest_row[r] = rest[r];
        }
        const Double8 half = broadcast(0.5 / PI * k[i]);
        for (int64_t j = 0; j < direction.shape[0]; ++j) {
            const Double8 along[3] = {broadcast(direction(j, 0)), broadcast(direction(j, 1)),
                                      broadcast(direction(j, 2))};
            const Double8 zero = broadcast(0.0);
            PatchSums sums{{zero, zero}, {zero, zero}, {zero, zero}};
            for (int64_t s = 0; s < whole; s += LANES) add_patches(row, s, half, along, sums);
            if (whole < count) add_patches(rest_row, 0, half, along, sums);
            // first + ik (second + i third) ahead; for the negative direction places and levers change their sign:
            // first* - ik (second* + i third*)
            const double first[2] = {total(sums.v[0]), total(sums.v[1])};
            const double second[2] = {total(sums.lever[0]), total(sums.lever[1])};
            const double third[2] = {total(sums.late[0]), total(sums.late[1])};
            ahead(i, j, 0) = first[0] - k[i] * (second[1] + third[0]);
            ahead(i, j, 1) = first[1] + k[i] * (second[0] - third[1]);
            behind(i, j, 0) = first[0] + k[i] * (third[0] - second[1]);
            behind(i, j, 1) = -first[1] - k[i] * (second[0] + third[1]);
        }
    }
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(FarField, far_field) = {VECTOR_LEVEL::sum_patches};

}  // namespace engine
