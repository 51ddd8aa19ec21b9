#include "nearest_point.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace engine {

namespace {

constexpr double LOOKS =
    1e-6;  // least cosine at which a face looks along the normal: not one at right angles, but for rounding

struct Barycentric {
    double u, v, w;
};

// The triangle's point nearest to p [Ericson 2005, p. 141], a return for each Voronoi region.
Barycentric in_triangle(const double p[3], const Face& face) {
    const double (&a)[3] = face.corner_m[0];
    const double (&b)[3] = face.corner_m[1];
    const double (&c)[3] = face.corner_m[2];
    const double ab[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const double ac[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    const double ap[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
    const double d1 = ab[0] * ap[0] + ab[1] * ap[1] + ab[2] * ap[2];
    const double d2 = ac[0] * ap[0] + ac[1] * ap[1] + ac[2] * ap[2];
    if (d1 <= 0 && d2 <= 0) return {1, 0, 0};
    const double bp[3] = {p[0] - b[0], p[1] - b[1], p[2] - b[2]};
    const double d3 = ab[0] * bp[0] + ab[1] * bp[1] + ab[2] * bp[2];
    const double d4 = ac[0] * bp[0] + ac[1] * bp[1] + ac[2] * bp[2];
    if (d3 >= 0 && d4 <= d3) return {0, 1, 0};
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) {
        const double v = d1 / (d1 - d3);
        return {1 - v, v, 0};
    }
    const double cp[3] = {p[0] - c[0], p[1] - c[1], p[2] - c[2]};
    const double d5 = ab[0] * cp[0] + ab[1] * cp[1] + ab[2] * cp[2];
    const double d6 = ac[0] * cp[0] + ac[1] * cp[1] + ac[2] * cp[2];
    if (d6 >= 0 && d5 <= d6) return {0, 0, 1};
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) {
        const double w = d2 / (d2 - d6);
        return {1 - w, 0, w};
    }
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0 && d4 >= d3 && d5 >= d6) {
        const double w = (d4 - d3) / std::max((d4 - d3) + (d5 - d6), 1e-300);
        return {0, 1 - w, w};
    }
    const double total = va + vb + vc;
    if (total <= 0) return {1, 0, 0};  // a sliver whose area rounds to nothing
    return {1 - vb / total - vc / total, vb / total, vc / total};
}

// The squared distance of p from a box.
double box_gap(const double p[3], const Node& node) {
    double squared = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const double gap = std::max({node.low_m[axis] - p[axis], 0.0, p[axis] - node.high_m[axis]});
        squared += gap * gap;
    }
    return squared;
}

}  // namespace

SurfacePoint nearest_point(const Surface& surface, const double p[3], const double outward[3]) {
    constexpr double infinite = std::numeric_limits<double>::infinity();
    const double tie_m = surface.tie_m;
    int64_t waiting[DEEPEST];
    double gaps[DEEPEST];
    SurfacePoint any{0, {1, 0, 0}, infinite}, looking{-1, {1, 0, 0}, infinite};
    double any_squared = infinite;
    double along = 0,
           least = infinite;  // of those that look along the normal: the chosen one's cosine, the least distance
    const bool asked = outward[0] != 0 || outward[1] != 0 || outward[2] != 0;
    int top = 1;
    waiting[0] = 0, gaps[0] = 0;
    while (top > 0) {
        --top;
        const double gap = gaps[top], reach = 2 * std::sqrt(any_squared) + surface.wall_m;
        if (gap >= any_squared && !(asked && gap < std::min((least + tie_m) * (least + tie_m), reach * reach)))
            continue;
        const int64_t (&child)[2] = surface.nodes[waiting[top]].child;
        if (child[0] >= 0) {
            const double gap_left = box_gap(p, surface.nodes[child[0]]),
                         gap_right = box_gap(p, surface.nodes[child[1]]);
            const int nearer = gap_left <= gap_right ? 1 : 0;  // visited first, on top of the stack
            waiting[top + nearer] = child[0], gaps[top + nearer] = gap_left;
            waiting[top + 1 - nearer] = child[1], gaps[top + 1 - nearer] = gap_right;
            top += 2;
            continue;
        }
        for (int64_t i = -child[0] - 1; i < child[1]; ++i) {
            const Face& face = surface.faces[i];
            const auto [u, v, w] = in_triangle(p, face);
            double squared = 0;
            for (int axis = 0; axis < 3; ++axis) {
                const double x =
                    u * face.corner_m[0][axis] + v * face.corner_m[1][axis] + w * face.corner_m[2][axis] - p[axis];
                squared += x * x;
            }
            if (squared < any_squared) {
                any_squared = squared;
                any = {i, {u, v, w}, 0};
            }
            const double cosine =
                outward[0] * face.normal[0] + outward[1] * face.normal[1] + outward[2] * face.normal[2];
            if (asked && cosine > LOOKS) {
                const double distance = std::sqrt(squared);
                if (distance < least - tie_m || (distance <= least + tie_m && cosine > along + 1e-9)) {
                    along = cosine;
                    looking = {i, {u, v, w}, distance};
                }
                least = std::min(least, distance);
            }
        }
    }
    any.distance_m = std::sqrt(any_squared);
    if (looking.face >= 0 && looking.distance_m <= 2 * any.distance_m + surface.wall_m) return looking;
    return any;
}

}  // namespace engine
