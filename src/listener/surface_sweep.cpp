#include "surface_sweep.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../math/rotation.hpp"
#include "../math/stable_order.hpp"
#include "kinematics.hpp"

namespace engine {

namespace {

constexpr double ROLL_MARGIN = 2.0;   // of the fastest that a contact rolls
constexpr double SLIP_MARGIN = 0.05;  // of the slip, by which it may be faster

// Poses of both links when the contact was loaded.
struct PairPose {
    double position_m[2][3];
    double quaternion_xyzw[2][4];
};

double square(double x) {
    return x * x;
}

// The velocity, world axes, of a contact displaced in the frame of a body of orientation q. The displacement is rotated
// into the tangent plane at full length: the chord of a rolling step leaves the plane by half the angle rolled; its
// length, not its projection, is the path.
void surface_velocity(const double now_m[3], const double before_m[3], double age_s, const double q[4],
                      const double normal[3], double velocity_m_s[3]) {
    const double moved[3] = {now_m[0] - before_m[0], now_m[1] - before_m[1], now_m[2] - before_m[2]};
    double d[3];
    rotate(q, moved, d);
    const double length2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    const double along = d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2];
    for (int x = 0; x < 3; ++x) d[x] = d[x] - along * normal[x];
    const double flat2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    const double scale = flat2 > 0.25 * length2 ? std::sqrt(length2 / flat2) / age_s : 1.0 / age_s;
    for (int x = 0; x < 3; ++x) velocity_m_s[x] = d[x] * scale;
}

// The smaller of |u_a| and |u_b|.
double slower(const double u[3], const double slip[3]) {
    const double a = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
    const double b = square(u[0] + slip[0]) + square(u[1] + slip[1]) + square(u[2] + slip[2]);
    return std::sqrt(std::min(a, b));
}

// The first of count traces, in the order of pairs, that is not before a pair.
int64_t first_of(Array<const ContactTrace, 1> trace, int64_t count, int64_t pair) {
    const auto is_before = [](const ContactTrace& one, int64_t other) { return one.pair < other; };
    return std::lower_bound(trace.data, trace.data + count, pair, is_before) - trace.data;
}

// Fill u_a of a trace whose time and points are set; false where no earlier contact of the pair matches. limit_m_s:
// largest speed of the slower sweep.
bool recognise(ContactTrace& fresh, int64_t pair, const TraceTables& traces, const PairPose& pose, const double slip[3],
               const double normal[3], double limit_m_s) {
    double best = std::numeric_limits<double>::infinity();
    bool known = false;
    double (&u)[3] = fresh.u_a_m_s;
    for (int step = 1; step <= MEMORY_STEPS; ++step) {
        const int64_t number = (traces.newest + step) % (MEMORY_STEPS + 1), count = traces.count[number];
        const Array<const ContactTrace, 1> trace{traces.table[number].data, {traces.table.shape[1]}};
        for (int64_t j = first_of(trace, count, pair); j < count && trace[j].pair == pair; ++j) {
            const ContactTrace& old = trace[trace[j].order];
            if (!known) std::copy(old.u_a_m_s, old.u_a_m_s + 3, u);
            known = true;
            if (fresh.time_s <= old.time_s) continue;
            const double age_s = fresh.time_s - old.time_s;
            double a[3], b[3], mean[3];
            surface_velocity(fresh.point_a_m, old.point_a_m, age_s, pose.quaternion_xyzw[0], normal, a);
            surface_velocity(fresh.point_b_m, old.point_b_m, age_s, pose.quaternion_xyzw[1], normal, b);
            for (int x = 0; x < 3; ++x) mean[x] = 0.5 * (a[x] + b[x] - slip[x]);
            const double speed = slower(mean, slip);
            if (speed <= limit_m_s && speed < best) {
                best = speed;
                std::copy(mean, mean + 3, u);
            }
        }
        if (best < std::numeric_limits<double>::infinity()) return true;
    }
    return known && slower(u, slip) <= limit_m_s;
}

// A contact's point in the frame of a link, by its pose when the contact was loaded; its distance from the centre.
double place(const double point_m[3], const double position_m[3], const double q[4], double local_m[3]) {
    const double arm[3] = {point_m[0] - position_m[0], point_m[1] - position_m[1], point_m[2] - position_m[2]};
    rotate_back(q, arm, local_m);
    return std::sqrt(local_m[0] * local_m[0] + local_m[1] * local_m[1] + local_m[2] * local_m[2]);
}

}  // namespace

void sweep_surfaces(const LoadedContact& contact, const LinkStart& a, const LinkStart& b, int64_t pair,
                    const double slip_m_s[3], const TraceTables& traces, ContactTrace& fresh, double speed_m_s[2]) {
    PairPose pose;
    pose_after(a, contact.elapsed_s, pose.position_m[0], pose.quaternion_xyzw[0]);
    pose_after(b, contact.elapsed_s, pose.position_m[1], pose.quaternion_xyzw[1]);
    const double far_a = place(contact.point_a_m, pose.position_m[0], pose.quaternion_xyzw[0], fresh.point_a_m);
    const double far_b = place(contact.point_b_m, pose.position_m[1], pose.quaternion_xyzw[1], fresh.point_b_m);
    const double *v = a.spin_rad_s, *w = b.spin_rad_s, *slip = slip_m_s;
    const double rolled_rad_s = std::sqrt(square(v[0] - w[0]) + square(v[1] - w[1]) + square(v[2] - w[2]));
    // the distant centre of a fixed body says nothing of its size
    const double reach_m = std::max({0.0, a.fixed ? 0.0 : far_a, b.fixed ? 0.0 : far_b});
    const double limit_m_s = ROLL_MARGIN * rolled_rad_s * reach_m +
                             SLIP_MARGIN * std::sqrt(slip[0] * slip[0] + slip[1] * slip[1] + slip[2] * slip[2]);
    double (&u)[3] = fresh.u_a_m_s;
    if (!recognise(fresh, pair, traces, pose, slip_m_s, contact.normal, limit_m_s)) {
        const double fraction = !a.fixed && (b.fixed || far_a <= far_b) ? 0.0 : -1.0;
        for (int x = 0; x < 3; ++x) u[x] = fraction * slip[x];
    }
    speed_m_s[0] = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    speed_m_s[1] = std::sqrt(square(u[0] + slip[0]) + square(u[1] + slip[1]) + square(u[2] + slip[2]));
}

void sort_pairs(Array<const Contact, 1> row, int64_t count, Array<ContactTrace, 1> trace, Array<int64_t, 2> sorting) {
    const Integers key = sorting[0].part(0, count);
    for (int64_t i = 0; i < count; ++i) key[i] = pair_key(row[i].a, row[i].b);
    const Integers order = stable_order(key, sorting[1].part(0, count), sorting[2].part(0, count));
    for (int64_t i = 0; i < count; ++i) trace[i].pair = key[order[i]], trace[i].order = order[i];
}

}  // namespace engine
