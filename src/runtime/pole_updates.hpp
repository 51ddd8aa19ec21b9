// Effect of resting contacts on a body: other poles while they last, and transmission to the bodies it touches.
//
//     ContactPatch of a body's pairs -> fill_touches: places on both bodies, springs of the regions that touch
//         -> couple_modes -> poles, transmission to each partner, contact separation -> the bank, from its next block
//         on
//
//     s = (−d + iω)/sr of the coupled modes, of a mode that they stop or make too fast one that decays within a block
//     separation of a mode: max over the touches of |F z|/load, for a modal velocity z of 1
//     w = (w_p/ω_p) V ω: weights of its modes in a partner's sound, V the velocity of the partner's modes per own
//     one's.
//         Pressure is iωρ₀ times velocity: it goes with the frequency at which a mode is moved; its other radiation is
//         taken at the mode's own.
//
// The driver chooses the bodies (`choose_bodies`): active ones whose contacts differ from those of their poles. The
// modes of each body stay its own, with its poles, but pairs of one frequency turn to the contact's axes
// (turned_modes.hpp); the small coupling of its other modes by the contacts is left out. Lines of a residual take the
// change of the mode that they follow. Chains of bodies are not claimed: a body's poles use its partners as they are
// free.
#pragma once

#include "../bank/layout.hpp"
#include "../contact/coupling/coupled_modes.hpp"
#include "../contact/coupling/touches.hpp"
#include "../groups.hpp"
#include "../math/elementary.hpp"

namespace engine {

constexpr double STOPPED_TURN = 0.05;  // radians a sample: decay, then, of a mode that the contacts stop

// Where a body's numbers lie in the flat arrays of PoleTables.
struct Mobility {
    int64_t modes;
    int64_t mode_at;  // of frequencies and decays
    int64_t pair_at;  // of the first modes of its pairs of one frequency, and how many
    int64_t pairs;
    int64_t follow_at;  // of the modes that the lines of its residual follow, and how many
    int64_t follows;
    int64_t weight_at;  // (W, modes)
    double gain;        // of its sound at sensors
};
ROW_FIELDS(Mobility, modes, mode_at, pair_at, pairs, follow_at, follows, weight_at, gain)

// What the bodies (b,) are without contacts: constants, kept where the poles are made anew.
struct PoleTables {
    Array<const Mobility, 1> mobility;
    Array<const double, 1> omega_rad_s;  // flat, as what follows
    Array<const double, 1> decay_per_s;
    Array<const int64_t, 1> pair;
    Array<const int64_t, 1> follow;
    Array<const Complex, 1> weight;
    Array<const double, 2> free_law;  // (6, lanes) of the bank
    TouchSides sides;
};
GROUP_FIELDS(PoleTables, mobility, omega_rad_s, decay_per_s, pair, follow, weight, free_law, sides)

// A body at its touches.
struct CoupledBody {
    int64_t touches = 0;  // c; without any the rest does not hold
    std::vector<int64_t> partners;
    std::vector<int64_t> partner_mode;         // where the modes of each begin among all partners' ones
    std::vector<double> load_n;                // (c,)
    std::vector<std::complex<double>> spring;  // (3c,)
    MotionPoles poles;                         // views of the scratch
    Array<double, 2> force_n_s;                // (c, m)
};

// Scratch, which grows as it is used.
struct PoleWork {
    CoupledWork coupling;
    std::vector<int64_t> places, begin, direction;
    std::vector<double> own, other, lam, decay, other_lam, other_decay, nothing;
    std::vector<double> numbers;  // of the poles
    std::vector<char> newton;
    std::vector<Turn> turn, turns;
    std::vector<Complex> step, weight;
    std::vector<double> separation, row;
    CoupledBody body;
};

// Tables of a state that poles are made of, and change.
struct ContactState {
    const BodyTables& table;
    const PairTables& pairs;
    const BankTables& bank;
    const ScratchTables& scratch;
    const PoleTables& poles;
};

// Limit a pole to what the bank can play: a mode that the contacts stop or make too fast decays within a block.
Complex limit_pole(Complex s, Complex free);

// Compute the touches of body b, which has modes, and its coupled modes into work.body. quaternion (b, 4): all bodies'.
// False where a number is not finite.
bool couple_body(int64_t b, Array<const double, 2> quaternion, const ContactState& state, PoleWork& work);

// Set the poles of body b, and what it transmits, to those of its contacts, from the bank's next block on.
bool update_poles(int64_t b, Array<const double, 2> quaternion, double sr, const ContactState& state, PoleWork& work);

}  // namespace engine
