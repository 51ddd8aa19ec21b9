// Poles of the motions of a body in contact: stiffness, a motion for each mode, and each motion's pole, transmission
// and forces. Equations: contact/coupling/first_order.py.
//
//     CoupledSystem                   -> couple_springs   both, stiffness
//     eigenvectors, pairs             -> choose_motions   which of them each mode becomes
//     CoupledSystem, Motions          -> solve_motions    MotionPoles
#pragma once

#include <complex>

#include "../../array.hpp"
#include "../../row_fields.hpp"

namespace engine {

constexpr double STOPPED_RATIO = 0.99;  // d over |s| of a motion that no longer oscillates: a contact stops it
// A new mode above so many times the highest own one is the contacts' own stiffness: its motion is stopped.
constexpr double STIFFEST_RATIO = 2.0;

// A body and its partners at r springs, as `coupled_modes.CoupledSystem` says: N = modes and six rigid motions of the
// body, P those of all partners side by side.
struct CoupledSystem {
    Array<const double, 2> own;                   // (r, N) motion at each spring of each of the body's motions
    Array<const double, 2> other;                 // (r, P) and of each of the partners'
    Array<const std::complex<double>, 1> spring;  // (r,) in N/m
    Array<const double, 1> lam;                   // (N,) λ = ω² + d² in 1/s²
    Array<const double, 1> decay;                 // (N,) in 1/s
    Array<const double, 1> other_lam;             // (P,)
    Array<const double, 1> other_decay;           // (P,)
    Array<const double, 1> plate;                 // (r,) y₀ in m/(N·s)
    Array<const double, 1> half_space;            // (r,) y₂ in m·s/N
};
GROUP_FIELDS(CoupledSystem, own, other, spring, lam, decay, other_lam, other_decay, plate, half_space)

// Motions of a body, and of its light partners, on its springs without losses.
struct Motions {
    Array<const double, 1> value;  // (n,) ω² of all
    Array<double, 2> vector;       // (n, n) of all, by columns; rows of pairs are turned in place
    Array<double, 2> both;         // (r, n) of `couple_springs`; columns of pairs are turned in place
    Integers chosen;  // (m,) that of each mode; of a pair put in the order in which they resemble those before
    Array<const int64_t, 1> pairs;  // (p,)
    Array<const double, 2> before;  // (m, m) earlier turn; (0, 0) for the identity
};
GROUP_FIELDS(Motions, value, vector, both, chosen, pairs, before)

// Poles of the motions chosen; see `coupled_modes.CoupledModes`.
struct MotionPoles {
    Doubles omega_rad_s;                   // (m,)
    Doubles decay_per_s;                   // (m,)
    Array<double, 2> turn;                 // (m, m)
    Array<double, 2> motion;               // (m, m)
    Array<double, 2> shares;               // (m, 3) of the decay: the body's own, the contacts', the partners'
    Array<bool, 1> newton;                 // (m,) whether the motion oscillates
    Array<double, 3> force;                // (2, r, m) at the springs, for a velocity of 1 of a motion
    Array<std::complex<double>, 2> moved;  // (partners' modes, m) their velocity
};
GROUP_FIELDS(MotionPoles, omega_rad_s, decay_per_s, turn, motion, shares, newton, force, moved)

// Compute both (r, n), motion at the springs of the body and of light partners' rigid motions, and their stiffness
// (n, n), Λ + bothᵀ Re(K) both. n: of `count_motions`.
void couple_springs(const CoupledSystem& system, Array<double, 2> both, Array<double, 2> stiffness);

// Count the motions that `couple_springs` makes a stiffness of.
int64_t count_motions(const CoupledSystem& system);

// Count the partners' modes: motions of theirs that are not rigid.
int64_t count_partner_modes(const CoupledSystem& system);

// Choose for each mode the column (m,) of vector (n, n) with most of it, of a pair the two with most of both.
//
// Where two choose the same, the first of them is -1: their sum is not the largest.
void choose_motions(Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen);

// Compute the poles of the motions chosen.
void solve_motions(const CoupledSystem& system, const Motions& motions, const MotionPoles& poles);

}  // namespace engine
