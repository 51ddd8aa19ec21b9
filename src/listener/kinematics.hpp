// Relative motion of two bodies at a contact, from their poses and twists before the step.
//
//     p' = Rᵀ(p − x)                               the point in a body's frame
//     v = V + ω × (p − x)                          velocity of the material there
//     approach = −(v_a − v_b)·n                    closing speed, n from b to a
//     slip = (v_a − v_b) − ((v_a − v_b)·n) n       tangential velocity of a's material relative to b's
#pragma once

#include "listener_tables.hpp"

namespace engine {

// Give a link's pose elapsed_s into the step, by its twist before it.
void pose_after(const LinkStart& link, double elapsed_s, double position_m[3], double quaternion_xyzw[4]);

// Return the approach in m/s of links a and b at a contact, and give their slip.
double relative_motion(const LoadedContact& contact, const LinkStart& a, const LinkStart& b, double slip_m_s[3]);

// Give the rotation vector in rad, world frame, between two orientations xyzw.
void rotation_between(const double first[4], const double second[4], double vector_rad[3]);

}  // namespace engine
