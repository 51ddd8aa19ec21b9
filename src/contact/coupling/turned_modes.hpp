// Pairs of modes of one frequency, turned to the axes of a body's contacts: all that has a lane for each mode turns.
//
//     S = R_oldᵀ R_new;   z' = Sᵀ z,  (Uᵀj)' = Sᵀ Uᵀj,  w' = w S        of each pair: ½|z|² and Σ w z stay
//
// Why they turn: sonic_bullet/runtime/supports/turned_modes.py.
#pragma once

#include "../../bank/layout.hpp"
#include "../../groups.hpp"

namespace engine {

// Tables that hold numbers of a body's modes: state and strikes under way, gains of the step's pulses and forces, and
// of its pairs.
struct ModeTables {
    const BankTables& bank;
    Array<double, 2> weight;               // the bank's
    Array<double, 2> transmission_weight;  // the bank's
    const ScratchTables& scratch;
    const PairTables& pairs;
};

// Turn the modes of body b from ``before`` to ``after``, both (m, m) or (0, 0) for the identity; neighbours, the first
// of each in pairs, mix alone. False, and nothing changes, where that is no turn or ``after`` is almost ``before``.
bool turn_modes(int64_t b, Array<const int64_t, 1> pairs, Array<const double, 2> before, Array<const double, 2> after,
                const ModeTables& tables);

}  // namespace engine
