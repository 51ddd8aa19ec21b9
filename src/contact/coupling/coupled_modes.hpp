// Coupled modes of a body in contact, in a millisecond: springs exactly, losses and the partners' mobility in one step.
//
//     (Λ + Bᵀ Re(K) B) q = ω² q,  B = (Φ, −Φ_r)     the body's modes and rigid motions, light partners' rigid motions
//     F_n = Re(K) B q_n,  s = jω_k                   forces at the touches, of each motion
//     g = Y F_k,  Y = 1/K − 1/Re K + Σ_j φ_j φ_jᵀ/(λ_j + 2 d_j s + s²)     compliance beside the springs, its motion
//     x = F_kᵀg,  ρ = gᵀRg/x,  R = Re K − Σ_{n≠k} F_n F_nᵀ/(ω_n² − ω_k²)   resistance of all other motions to it
//     δ = x/(1 + ρ),  ε = dδ/ds²                     exact at one touch, or of one compliant motion
//     s² + 2 s qᵀDq + ω² − 2δ/(1 + √(1 − 4ε)) = 0    δ taken on as the one pole c²/(D + s²) of this value and slope
//
// Of det(1 + Y(s)(Re K − Σ_n F_n F_nᵀ/(ω_n² + s²))) = 0, the springs' ends held and then released. To first order in x
// it is Rayleigh's quotient, from which Newton's iteration finds the exact pole at many times the cost
// (docs/measured/in-place.md has the difference).
//
// A mode takes the pole of the motion that most resembles its free one; of a pair of one frequency the two motions that
// most resemble both, to whose axes it turns: which two of all orthogonal ones the free modes are does not count.
// Transmission, at most ½ of each such motion, and contact forces are those of the mode's own motion, Q of all.
#pragma once

#include "../../math/assignment.hpp"
#include "motion_poles.hpp"

namespace engine {

struct CoupledWork {
    MotionWork motions;
    AssignmentWork assignment;
    std::vector<double> both, stiffness, vector, value, eigen, row, fraction;
    std::vector<int64_t> chosen;
};

// Compute the poles of a body's m modes at r springs, neither 0; and the normal force at each of its c touches,
// force_n_s (c, m): its amplitude in N for a velocity amplitude of 1 of a new mode. direction (r,): which of the 3c
// directions of the touches, normal and both tangents each, a spring is. pairs (p,): the first of each two modes of one
// frequency; before: their earlier turns, where they have some. False where a number is not finite.
bool couple_modes(const CoupledSystem& system, Array<const int64_t, 1> direction, Array<const int64_t, 1> pairs,
                  Array<const Turn, 1> before, const MotionPoles& poles, Array<double, 2> force_n_s, CoupledWork& work);

}  // namespace engine
