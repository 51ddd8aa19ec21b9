// Rows of the listener: what a simulator reports of a step, and what is remembered of the steps before.
//
//     RAW (as reported) -> TOUCH (loaded, as impulses) + START (links at the step's start) -> Contact rows, TRACE
//
// A link's code is body · LINK_SPAN + link + 1: rows of links are ascending in it.
#pragma once

#include "../tables.hpp"

namespace engine {

constexpr int64_t LINK_SPAN = 1 << 20;
constexpr int64_t LEFT_OUT = -2;        // index of a link whose contacts are dropped
constexpr double INVALID_BEYOND = 1e9;  // bound of valid numbers in m, m/s, rad/s, N·s: no scene reaches it, and
                                        // products of smaller ones stay finite
constexpr double LARGEST_SI = 1e30;     // bound of what a contact's row may say: records.arrays
constexpr int MEMORY_STEPS = 5;         // steps among which a contact is looked for again

// Pose and twist of a link: its centre of mass, axes along the principal inertia.
struct LinkState {
    double position_m[3];
    double quaternion_xyzw[4];
    double velocity_m_s[3];
    double spin_rad_s[3];
};
ROW_FIELDS(LinkState, position_m, quaternion_xyzw, velocity_m_s, spin_rad_s)

// A link at the start of a step.
struct LinkStart {
    double position_m[3];
    double quaternion_xyzw[4];
    double velocity_m_s[3];
    double spin_rad_s[3];
    int64_t code;
    int64_t fixed;  // 1 where its mass is 0
    int64_t index;  // into the bodies of the log; -1 without a contact yet, LEFT_OUT
    int64_t pose;   // where index is not below 0: its row among the step's poses
    int64_t moved;  // 1 where it was set elsewhere by hand since the step before
    int64_t born;   // 1 in its first step
    int64_t met;    // 1 in its first contact
};
ROW_FIELDS(LinkStart, position_m, quaternion_xyzw, velocity_m_s, spin_rad_s, code, fixed, index, pose, moved, born, met)

// A contact as PyBullet's getContactPoints() reports it, in its order, without its first entry.
struct ReportedContact {
    int64_t body_a;
    int64_t body_b;
    int64_t link_a;
    int64_t link_b;
    double point_a_m[3];
    double point_b_m[3];
    double normal[3];
    double gap_m;
    double force_n;
    double friction_1_n;
    double tangent_1[3];
    double friction_2_n;
    double tangent_2[3];
};
ROW_FIELDS(ReportedContact, body_a, body_b, link_a, link_b, point_a_m, point_b_m, normal, gap_m, force_n, friction_1_n,
           tangent_1, friction_2_n, tangent_2)

// A loaded contact, world frame.
struct LoadedContact {
    int64_t code_a;
    int64_t code_b;
    double point_a_m[3];
    double point_b_m[3];
    double normal[3];
    double gap_m;
    double impulse_n_s[3];  // on a
    double elapsed_s;       // from the start of the step to the start of the sub-step that loaded it
};
ROW_FIELDS(LoadedContact, code_a, code_b, point_a_m, point_b_m, normal, gap_m, impulse_n_s, elapsed_s)

// A contact of one step, and its place in the order of pairs.
struct ContactTrace {
    double time_s;
    double point_a_m[3];  // in the body's frame
    double point_b_m[3];
    double u_a_m_s[3];  // in the world's axes
    int64_t pair;       // the j-th entry: pair and row of the j-th contact in the order of pairs
    int64_t order;
};
ROW_FIELDS(ContactTrace, time_s, point_a_m, point_b_m, u_a_m_s, pair, order)

// An impact of a soft contact, under way.
struct SoftImpact {
    int64_t key;          // of the pair, lower body first
    double approach_m_s;  // largest closing speed so far
    double latest_m_s;
    double meets_s;    // gap over approach as it began: after the start of its first step; 0: not known
    double support_n;  // load before it began, or the weight
    double peak_n;     // largest load so far
    int64_t steps;
    double elapsed_s;
    int64_t over;
};
ROW_FIELDS(SoftImpact, key, approach_m_s, latest_m_s, meets_s, support_n, peak_n, steps, elapsed_s, over)

// A point of an impact under way, and what it holds back.
struct HeldPoint {
    int64_t key;
    Contact row;         // sums so far: impulse; points and normal weighted by load; slip, sweep of the first
    double latest_m[3];  // its point in the frame of the body a
    double weight_n_s;
    int64_t taken;
};
ROW_FIELDS(HeldPoint, key, row, latest_m, weight_n_s, taken)

// A pair in one step.
struct PairLoad {
    int64_t key;
    double force_n;
    double weight_n;
    double approach_m_s;
    double gap_m;
    int64_t impact;  // its place among the impacts, or -1
};
ROW_FIELDS(PairLoad, key, force_n, weight_n, approach_m_s, gap_m, impact)

}  // namespace engine
