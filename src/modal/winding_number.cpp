#include "winding_number.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"

namespace engine {

namespace {

// The solid angle of a triangle seen from a point, positive from behind [Van Oosterom & Strackee 1983, eq. 8].
double solid_angle(const double* corner, const double p[3]) {
    double r[3][3], length[3];
    for (int i = 0; i < 3; ++i) {
        for (int x = 0; x < 3; ++x) r[i][x] = corner[3 * i + x] - p[x];
        length[i] = std::sqrt(r[i][0] * r[i][0] + r[i][1] * r[i][1] + r[i][2] * r[i][2]);
    }
    const auto &a = r[0], &b = r[1], &c = r[2];
    const double ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2], bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2],
                 ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2];
    const double volume =
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    return 2 * atan2(volume, length[0] * length[1] * length[2] + ab * length[2] + bc * length[0] + ca * length[1]);
}

struct Waiting {
    int64_t level, group;
};

}  // namespace

void winding_numbers(Array<const double, 3> corner_m, Array<const double, 2> group, Array<const int64_t, 1> first,
                     Array<const double, 2> point_m, Doubles winding) {
    // a group is replaced by its children at most: so many wait of each level
    Waiting waiting[(DIPOLE_LEVELS + 1) * DIPOLE_GROUPS];
    const int64_t top = first.size() - 2;
    for (int64_t k = 0; k < point_m.size(); ++k) {
        const double* p = point_m[k].data;
        int64_t count = first[top + 1] - first[top];
        for (int64_t i = 0; i < count; ++i) waiting[i] = {top, count - 1 - i};
        double angle = 0;
        while (count > 0) {
            const auto [level, which] = waiting[--count];
            const Array<const double, 1> g = group[first[level] + which];
            const double a = g[0] - p[0], b = g[1] - p[1], c = g[2] - p[2];
            const double away = std::sqrt(a * a + b * b + c * c);
            if (away > g[6]) {
                angle += (a * g[3] + b * g[4] + c * g[5]) / (away * away * away);
            } else if (level > 0) {
                const int64_t end = std::min((which + 1) * DIPOLE_GROUPS, first[level] - first[level - 1]);
                for (int64_t child = end - 1; child >= which * DIPOLE_GROUPS; --child)
                    waiting[count++] = {level - 1, child};
            } else {
                const int64_t end = std::min((which + 1) * DIPOLE_FACES, corner_m.size());
                for (int64_t f = which * DIPOLE_FACES; f < end; ++f) angle += solid_angle(corner_m[f].data, p);
            }
        }
        winding[k] = angle / (4 * std::numbers::pi);
    }
}

}  // namespace engine
