// Pairs of modes of one frequency, turned to the axes of a body's contacts: all that has a lane for each mode turns.
//
//     ψ' = ψ R,  z' = Rᵀ z,  (Uᵀj)' = Rᵀ Uᵀj,  w' = w R      of each pair, R orthogonal: ½|z|² and Σ w z stay
//     S = R_oldᵀ R_new;   z' = Sᵀ z,  (Uᵀj)' = Sᵀ Uᵀj,  w' = w S      from one turn to the next
//
// The free modes of a round body are any two of a pair's plane: which two, a mesh decides. At a contact one motion
// moves it and decays, another has a node there. With them as the modes, what a strike leaves ringing does not hang on
// the mesh. Without contacts R is the identity.
#pragma once

#include <vector>

#include "../../bank/layout.hpp"
#include "../../groups.hpp"

namespace engine {

// Tables that hold numbers of a body's modes: its own turns, state and strikes under way, gains of the step's pulses
// and forces, and of its pairs.
struct ModeTables {
    const BodyTables& table;
    const BankTables& bank;
    const ScratchTables& scratch;
    const PairTables& pairs;
};

// Give the present turns of body b; of other pairs it is the identity.
inline Array<Turn, 1> turns_of(int64_t b, const BodyTables& table) {
    const Body& body = table.bodies[b];
    return table.turns.part(body.turn_at, body.turn_at + body.turns);
}

// Turn the modes of body b from its present turns to ``after``, a row for each of its pairs, ascending; to none where
// it is free. False, and nothing changes, where that is no turn or, unless it is free, almost the present one. turns:
// scratch.
bool turn_modes(int64_t b, Array<const Turn, 1> after, bool free, const ModeTables& tables, std::vector<Turn>& turns);

}  // namespace engine
