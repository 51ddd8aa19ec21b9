#include "panels.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace engine {

static Panel make_panel(Array<const double, 2> corner_m, Array<const double, 1> normal) {
    Panel panel;
    for (int e = 0; e < 3; ++e) {
        double t[3];
        for (int axis = 0; axis < 3; ++axis) {
            panel.corner_m[e][axis] = corner_m(e, axis);
            t[axis] = corner_m((e + 1) % 3, axis) - corner_m(e, axis);
        }
        const double length = std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
        panel.edge_m[e] = length;
        panel.across[e][0] = (t[1] * normal[2] - t[2] * normal[1]) / length;
        panel.across[e][1] = (t[2] * normal[0] - t[0] * normal[2]) / length;
        panel.across[e][2] = (t[0] * normal[1] - t[1] * normal[0]) / length;
    }
    for (int axis = 0; axis < 3; ++axis) panel.normal[axis] = normal[axis];
    return panel;
}

void static_kernels(Array<const double, 3> corner_m, Array<const double, 2> normal, Array<double, 3> out) {
    constexpr int64_t lanes = 8;
    const int64_t count = corner_m.shape[0];
    std::vector<Targets> targets((count + lanes - 1) / lanes);
    for (int64_t i = 0; i < static_cast<int64_t>(targets.size()) * lanes; ++i) {
        const int64_t from = std::min(i, count - 1);  // the last repeated, where it does not fill eight
        Targets& group = targets[i / lanes];
        for (int axis = 0; axis < 3; ++axis) {
            group.place_m[axis][i % lanes] =
                (corner_m(from, 0, axis) + corner_m(from, 1, axis) + corner_m(from, 2, axis)) / 3;
            group.normal[axis][i % lanes] = normal(from, axis);
        }
    }
    for (int64_t j = 0; j < count; ++j) {
        const Panel panel = make_panel(corner_m[j], normal[j]);
        for (int64_t i = 0; i < count; i += lanes) {
            double found[4][lanes];
            panels().integrate(panel, targets[i / lanes], found);
            for (int kernel = 0; kernel < 4; ++kernel)
                std::copy_n(found[kernel], std::min(lanes, count - i), &out(kernel, j, i));
        }
        // seen from its own plane: no solid angle, whatever the rounding, nor what that adds to K'
        const double turned = normal(j, 0) * normal(j, 0) + normal(j, 1) * normal(j, 1) + normal(j, 2) * normal(j, 2);
        out(2, j, j) += turned * out(1, j, j);
        out(1, j, j) = 0;
    }
}

}  // namespace engine
