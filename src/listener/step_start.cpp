#include "step_start.hpp"

#include <algorithm>
#include <cmath>

#include "kinematics.hpp"

namespace engine {

namespace {

constexpr double DRIVEN_M_S = 10.0;    // a body of mass 0 that is driven faster jumps
constexpr double JUMP_FLOOR_M = 1e-3;  // shorter moves are none by hand
constexpr double SPEED_MARGIN = 1.5;   // of both speeds: what they explain
constexpr int STATE_NUMBERS = sizeof(LinkState) / sizeof(double);

double squared(const double v[3]) {
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

// Tell whether a link moved farther than its speeds explain.
bool jumps(const LinkState& earlier, const LinkState& later, bool fixed, double dt_s) {
    double move[3];
    for (int x = 0; x < 3; ++x) move[x] = later.position_m[x] - earlier.position_m[x];
    const double reach_m_s =
        fixed ? DRIVEN_M_S
              : SPEED_MARGIN * (std::sqrt(squared(later.velocity_m_s)) + std::sqrt(squared(earlier.velocity_m_s)));
    return std::sqrt(squared(move)) > reach_m_s * dt_s + JUMP_FLOOR_M;
}

// Give a link of mass 0 whose pose was reset since `earlier` the velocity of that move.
void drive(const LinkState& earlier, const LinkState& later, double dt_s, LinkStart& link) {
    if (std::equal(earlier.position_m, earlier.position_m + 3, later.position_m) &&
        std::equal(earlier.quaternion_xyzw, earlier.quaternion_xyzw + 4, later.quaternion_xyzw))
        return;
    rotation_between(earlier.quaternion_xyzw, later.quaternion_xyzw, link.spin_rad_s);
    for (int x = 0; x < 3; ++x) {
        link.velocity_m_s[x] = (later.position_m[x] - earlier.position_m[x]) / dt_s;
        link.spin_rad_s[x] /= dt_s;
    }
}

}  // namespace

int64_t begin_step(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later, double dt_s,
                   Array<const int64_t, 1> moved_bodies, bool hooked, Array<LinkStart, 1> start) {
    int64_t count = 0;
    for (int64_t i = 0; i < start.size(); ++i) {
        LinkStart& link = start[i];
        const LinkState& now = later[i];
        const bool fixed = link.fixed != 0;
        bool moved = jumps(earlier[i], now, fixed, dt_s);
        if (!fixed)
            for (int64_t j = 0; j < moved_bodies.size(); ++j) moved = moved || moved_bodies[j] == link.code / LINK_SPAN;
        const LinkState& at = hooked || fixed ? now : earlier[i];
        std::copy(at.position_m, at.position_m + 3, link.position_m);
        std::copy(at.quaternion_xyzw, at.quaternion_xyzw + 4, link.quaternion_xyzw);
        std::copy(at.velocity_m_s, at.velocity_m_s + 3, link.velocity_m_s);
        std::copy(at.spin_rad_s, at.spin_rad_s + 3, link.spin_rad_s);
        if (fixed) drive(earlier[i], now, dt_s, link);
        link.moved = moved, link.born = 0, link.met = 0;
        count += moved;
    }
    return count;
}

bool is_unmoved(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later) {
    const auto *a = reinterpret_cast<const double*>(earlier.data), *b = reinterpret_cast<const double*>(later.data);
    return std::equal(b, b + later.size() * STATE_NUMBERS, a);
}

}  // namespace engine
