// Poles of the motions of a body in contact: stiffness, a motion for each mode, and each motion's pole, transmission
// and forces. Equations: coupled_modes.hpp.
//
//     CoupledSystem                   -> couple_springs   both, stiffness
//     eigenvectors, pairs             -> choose_motions   which of them each mode becomes
//     CoupledSystem, Motions          -> solve_motions    MotionPoles
#pragma once

#include <complex>
#include <vector>

#include "../../array.hpp"
#include "../../row_fields.hpp"
#include "../../tables.hpp"

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
    Array<const Turn, 1> before;    // earlier turns of some of them, ascending; of the others the identity
};

// Poles of the motions chosen; see `coupled_modes.CoupledModes`.
struct MotionPoles {
    Doubles omega_rad_s;      // (m,)
    Doubles decay_per_s;      // (m,)
    Array<Turn, 1> turn;      // (p,) of each pair
    Array<double, 2> motion;  // (m, m) by rows, of each mode's motion the part of every mode, turned
    Array<double, 2> shares;  // (m, 3) of the decay: the body's own, the contacts', the partners'
    Array<bool, 1> newton;    // (m,) whether the motion oscillates
    Array<double, 3> force;   // (2, r, m) at the springs, for a velocity of 1 of a motion; real parts first
    Array<double, 3> moved;   // (2, partners' modes, m) their velocity
};
GROUP_FIELDS(MotionPoles, omega_rad_s, decay_per_s, turn, motion, shares, newton, force, moved)

// Compute both (r, n), motion at the springs of the body and of light partners' rigid motions, and their stiffness
// (n, n), Λ + bothᵀ Re(K) both. n: of `count_motions`; factor (r·n,): scratch.
void couple_springs(const CoupledSystem& system, Array<double, 2> both, Array<double, 2> stiffness, Doubles factor);

// Count the motions that `couple_springs` makes a stiffness of.
int64_t count_motions(const CoupledSystem& system);

// Count the partners' modes: motions of theirs that are not rigid.
int64_t count_partner_modes(const CoupledSystem& system);

// Choose for each mode the column (m,) of vector (n, n) with most of it, of a pair the two with most of both.
//
// Where two choose the same, the first of all is -1: their sum is not the largest. part (n,): scratch.
void choose_motions(Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen, Doubles part);

// Scratch of the m motions chosen, on their way to poles: complex numbers as real parts, then imaginary ones.
struct MotionWork {
    static constexpr int64_t PRODUCTS = 8;  // motions whose work on the chosen ones is computed at once

    int64_t springs;             // r
    int64_t motions;             // m
    int64_t partner_modes;       // P
    std::vector<double> every;   // (r, n) force at the springs of all motions
    std::vector<double> free;    // (m,) ω², as it is
    std::vector<double> square;  // (m,) ω², not below 0
    std::vector<double> rate;    // (m,) ω
    std::vector<double> damped;  // (m,) qᵀDq
    std::vector<double> force;   // (r, m)
    std::vector<double> gives;   // (2, r, m) compliant motion at the springs
    std::vector<double>
        moved;  // (4, P, m): real and imaginary part of the motion of each partner's mode, and compliance
    std::vector<double> slope;    // (2, m) Σ moved²
    std::vector<double> contact;  // (2, m) Fᵀg of the springs' loss, and of the partners
    std::vector<double> partner;  // (2, m)
    std::vector<double> held;     // (2, m) gᵀRg
    std::vector<double> part;     // (2, m) 1/(1 + ρ), and δ times it
    std::vector<double> shift;    // (2, m)
    std::vector<double> pressed, products, row;

    // Make room for n motions of all, m chosen, of r springs; what is summed is 0.
    void fit(int64_t r, int64_t m, int64_t n, int64_t modes);
};

// Compute the poles of the motions chosen.
void solve_motions(const CoupledSystem& system, const Motions& motions, const MotionPoles& poles, MotionWork& work);

}  // namespace engine
