#include "touches.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "../../math/elementary.hpp"
#include "../contact_place.hpp"
#include "../strike_forces.hpp"
#include "patch_points.hpp"

namespace engine {

namespace {

constexpr double SQUARE = 1.1283791670955126;  // 2/√π: half-axes of an ellipse over those of its area's rectangle
// Of a patch's spread: where its middle is nearer than this to a surface, all between its points touches.
constexpr double ON_SURFACE = 0.02;
constexpr double NARROW = 0.1;     // least width of a face over its length: where two corners alone are known
constexpr double SLIPPERY = 1e-9;  // of the normal spring: what holds two bodies sideways that have no friction

// Contact region along two axes, as `springs.Region`.
struct Region {
    double half_m[2];
    double curvature_per_m[2];
};

// Complex stiffness along the normal, and across it.
struct Spring {
    std::complex<double> normal, tangential;
};

// Turn columns i, j of the basis and rows and columns of the symmetric product so that its element (i, j) is 0
// [Jacobi].
void eliminate(int i, int j, double (&product)[3][3], double (&basis)[3][3]) {
    if (product[i][j] == 0) return;
    const double ratio = (product[j][j] - product[i][i]) / (2 * product[i][j]);
    const double t = (ratio >= 0 ? 1.0 : -1.0) / (std::fabs(ratio) + std::sqrt(ratio * ratio + 1));
    const double c = 1 / std::sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < 3; ++k) {
        const double x = product[k][i], y = product[k][j];
        product[k][i] = c * x - s * y, product[k][j] = s * x + c * y;
    }
    for (int k = 0; k < 3; ++k) {
        const double x = product[i][k], y = product[j][k];
        product[i][k] = c * x - s * y, product[j][k] = s * x + c * y;
        const double u = basis[k][i], v = basis[k][j];
        basis[k][i] = c * u - s * v, basis[k][j] = s * u + c * v;
    }
}

// Half-lengths of the points (count, 3) about their middle along the two directions in which they spread most.
void spread_along_axes(const double (&point)[POINTS][3], int64_t count, double (&half)[2]) {
    double product[3][3] = {}, basis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int64_t k = 0; k < count; ++k)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) product[i][j] += point[k][i] * point[k][j];
    for (int sweep = 0; sweep < 8; ++sweep)  // each squares what is left
        for (int i = 0; i < 2; ++i)
            for (int j = i + 1; j < 3; ++j) eliminate(i, j, product, basis);
    int order[3] = {0, 1, 2};
    const auto is_longer = [&](int i, int j) { return product[i][i] > product[j][j]; };
    for (int i = 1; i < 3; ++i)  // equal ones as they stand, and no memory asked for, as std::stable_sort does
        for (int j = i; j > 0 && is_longer(order[j], order[j - 1]); --j) std::swap(order[j], order[j - 1]);
    for (int a = 0; a < 2; ++a) {
        half[a] = 0;
        for (int64_t k = 0; k < count; ++k) {
            double along = 0;
            for (int i = 0; i < 3; ++i) along += point[k][i] * basis[i][order[a]];
            half[a] = std::max(half[a], std::fabs(along));
        }
    }
}

// The line or face that touches between a patch's points; false where there is none.
bool find_region(const ContactPatch& patch, double curvature_per_m, double off_m, double size_m, Region& region) {
    double point[POINTS][3], mean[3] = {}, square = 0;
    for (int x = 0; x < 3; ++x) {
        for (int64_t k = 0; k < patch.count; ++k) mean[x] += patch.point_m[k][0][x];
        mean[x] /= static_cast<double>(patch.count);
        double low = INFINITY, high = -INFINITY;
        for (int64_t k = 0; k < patch.count; ++k) {
            point[k][x] = patch.point_m[k][0][x] - mean[x];
            low = std::min(low, point[k][x]), high = std::max(high, point[k][x]);
        }
        square += (high - low) * (high - low);
    }
    const double spread = std::sqrt(square);
    if (spread < STRUCK_FLAT * size_m || off_m > ON_SURFACE * spread) return false;
    double half[2];
    spread_along_axes(point, patch.count, half);
    if (curvature_per_m * size_m > FLAT_CURVATURE)  // mean of both principal curvatures, of which a line has one
        region = {{half[0], 0.0}, {0.0, 2 * curvature_per_m}};
    else
        region = {{half[0], std::max(half[1], NARROW * half[0])}, {0.0, 0.0}};
    return true;
}

// Half-axes a >= b of the ellipse that touches under a load. modulus_pa: E*.
void half_axes(const Region& region, double modulus_pa, double load_n, double (&axes)[2]) {
    const double (&half)[2] = region.half_m;
    const double (&curvature)[2] = region.curvature_per_m;
    if (half[0] == 0 && half[1] == 0) {
        const double small = std::min(curvature[0], curvature[1]), large = std::max(curvature[0], curvature[1]);
        const double mean = engine::pow(3 * load_n / (4 * modulus_pa * std::sqrt(small * large)), 1.0 / 3.0);
        const double longer = engine::pow(large / small, 1.0 / 3.0);
        axes[0] = mean * longer, axes[1] = mean / longer;
        return;
    }
    double a = half[0], b = half[1];
    if (a == 0 || b == 0) {
        const double curved = curvature[a == 0 ? 0 : 1];
        a = std::max(a, b);
        b = std::sqrt(2 * load_n / (std::numbers::pi * modulus_pa * a * curved));
    }
    axes[0] = SQUARE * std::max(a, b), axes[1] = SQUARE * std::min(a, b);
}

// The whole region's spring under the whole load.
Spring contact_spring(const Region& region, const int64_t (&both)[2], double load_n, const TouchSides& sides) {
    const double first = sides.compliance_per_pa[both[0]], second = sides.compliance_per_pa[both[1]];
    const double whole = first + second;
    double axes[2];
    half_axes(region, 1 / whole, load_n, axes);
    double larger = axes[0], smaller = axes[1];
    while (larger - smaller > 1e-15 * larger) {  // each step doubles the digits
        const double mean = (larger + smaller) / 2;
        smaller = std::sqrt(larger * smaller), larger = mean;
    }
    const double smooth = 2 * larger / whole;
    const double one = sides.roughness_m[both[0]], other = sides.roughness_m[both[1]];
    const double layer_m = PERSSON * std::sqrt(one * one + other * other);
    const double loss = (first * sides.loss_factor[both[0]] + second * sides.loss_factor[both[1]]) / whole;
    const double real = 1 / (1 / smooth + layer_m / load_n);
    const double poisson = (first * sides.poisson[both[0]] + second * sides.poisson[both[1]]) / whole;
    const double across = 2 * (1 - poisson) / (2 - poisson);
    const std::complex<double> normal{real, loss * real};
    const bool slips = sides.slips[both[0]] || sides.slips[both[1]];
    return {normal, normal * (slips ? SLIPPERY : across)};
}

// Write the springs of a patch's points, (3·count,): parts of one region, or regions of their own.
void write_springs(const ContactPatch& patch, const int64_t (&both)[2], const double (&curvature_per_m)[POINTS],
                   double off_m, const BodyTables& tables, const TouchSides& sides, std::complex<double>* out) {
    double size_m = INFINITY, mean = 0, whole = 0;
    for (const int64_t b : both)
        if (tables.bodies[b].volume_m3 > 0) size_m = std::min(size_m, tables.bodies[b].size_m);
    if (size_m == INFINITY) size_m = SIZELESS_M;
    for (int64_t k = 0; k < patch.count; ++k) mean += curvature_per_m[k], whole += patch.load_n[k];
    mean /= static_cast<double>(patch.count);
    Region region;
    const bool one_region = find_region(patch, mean, off_m, size_m, region);
    Spring spring{};
    if (one_region) spring = contact_spring(region, both, whole, sides);
    for (int64_t k = 0; k < patch.count; ++k) {
        double part = patch.load_n[k] / whole;
        if (!one_region) {
            const double small = STRUCK_FLAT * size_m, bent = curvature_per_m[k];
            region =
                bent * size_m <= FLAT_CURVATURE ? Region{{small, small}, {0.0, 0.0}} : Region{{0.0, 0.0}, {bent, bent}};
            spring = contact_spring(region, both, patch.load_n[k], sides);
            part = 1.0;
        }
        out[3 * k] = spring.normal * part;
        out[3 * k + 1] = out[3 * k + 2] = spring.tangential * part;
    }
}

}  // namespace

void fill_touches(int64_t b, Array<const int64_t, 1> places, Array<const int64_t, 1> begin, const BodyTables& tables,
                  const PairTables& pairs, Array<const double, 2> quaternion, const TouchSides& sides,
                  const Touches& touches) {
    std::vector<double> there;
    int64_t first = 0;
    for (int64_t i = 0; i < places.size(); ++i) {
        const ContactPatch& patch = pairs.patch[places[i]];
        const int64_t both[2] = {pairs.pair[places[i]].body[0], pairs.pair[places[i]].body[1]}, count = patch.count;
        const int side = both[0] == b ? 0 : 1;
        const int64_t own = touches.own.shape[1], columns = touches.other.shape[1];
        const int64_t width = tables.bodies[both[1 - side]].modes + 6;
        there.assign(3 * count * width, 0.0);
        Array<double, 3> moves[2];
        moves[side] = {touches.own.data + 3 * first * own, {count, 3, own}};
        moves[1 - side] = {there.data(), {count, 3, width}};
        double turns[2][9], curvature[POINTS] = {};
        for (int s = 0; s < 2; ++s) std::copy_n(sides.turns[both[s]].data, 9, turns[s]);
        const double off_m =
            place_points(tables, quaternion, patch, both, {&turns[0][0], {2, 3, 3}}, moves, {curvature, {count}});
        for (int64_t row = 0; row < 3 * count; ++row)
            std::copy_n(&there[row * width], width, touches.other.data + (3 * first + row) * columns + begin[i]);
        write_springs(patch, both, curvature, off_m, tables, sides, touches.spring.data + 3 * first);
        std::copy_n(patch.load_n, count, touches.load_n.data + first);
        first += count;
    }
}

}  // namespace engine
