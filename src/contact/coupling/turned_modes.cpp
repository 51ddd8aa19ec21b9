#include "turned_modes.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

namespace {

// Largest element, in radians about, of a turn that is left out: cos² of it is 1 within 0.3 %.
constexpr double SAME_TURN = 0.05;

using Matrix = double[2][2];

bool is_identity(const Matrix& by) {
    return by[0][0] == 1 && by[0][1] == 0 && by[1][0] == 0 && by[1][1] == 1;
}

// The turn of a pair among rows (ascending): the next one, where it is of this mode, else the identity.
void read_turn(Array<const Turn, 1> rows, int64_t& next, int64_t mode, Matrix& by) {
    by[0][0] = by[1][1] = 1.0, by[0][1] = by[1][0] = 0.0;
    while (next < rows.size() && rows[next].mode < mode) ++next;
    if (next < rows.size() && rows[next].mode == mode) std::copy_n(&rows[next].by[0][0], 4, &by[0][0]);
}

void turn_lanes(double* lanes, const std::vector<Turn>& turns) {
    for (const Turn& turn : turns) {
        const double one = lanes[turn.mode], other = lanes[turn.mode + 1];
        lanes[turn.mode] = one * turn.by[0][0] + other * turn.by[1][0];
        lanes[turn.mode + 1] = one * turn.by[0][1] + other * turn.by[1][1];
    }
}

void turn_bank(int64_t b, const std::vector<Turn>& turns, const ModeTables& tables) {
    const BankTables& bank = tables.bank;
    const int64_t modes = bank.law.shape[1], start = bank.body[b].start;
    for (const int64_t part : {start, modes + start}) {
        turn_lanes(bank.z.data + part, turns);
        turn_lanes(bank.driven.data + part, turns);
        for (const Array<double, 2>& weight : {bank.weight, bank.transmission_weight})
            for (int64_t w = 0; w < weight.shape[0]; ++w) turn_lanes(weight[w].data + part, turns);
    }
    for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next)
        for (int row = 0; row < 2; ++row) turn_lanes(bank.rows[slot][row].data, turns);  // r, which holds the gain
}

}  // namespace

bool turn_modes(int64_t b, Array<const Turn, 1> after, bool free, const ModeTables& tables, std::vector<Turn>& turns) {
    Body& body = tables.table.bodies[b];
    const Array<Turn, 1> present = turns_of(b, tables.table);
    const Array<const Turn, 1> pairs = free ? Array<const Turn, 1>(present) : after;  // all that may change
    turns.clear();
    double largest = 0;
    int64_t next = 0;
    for (int64_t i = 0; i < pairs.size(); ++i) {
        Turn turn{pairs[i].mode, {}};
        Matrix old, made{{1, 0}, {0, 1}};
        read_turn(present, next, turn.mode, old);
        if (!free) std::copy_n(&after[i].by[0][0], 4, &made[0][0]);
        for (int j = 0; j < 2; ++j)
            for (int k = 0; k < 2; ++k) {
                turn.by[j][k] = old[0][j] * made[0][k] + old[1][j] * made[1][k];
                largest = std::max(largest, std::fabs(turn.by[j][k] - (j == k ? 1.0 : 0.0)));
            }
        if (!is_identity(turn.by)) turns.push_back(turn);
    }
    if (turns.empty() || (!free && largest < SAME_TURN)) return false;
    turn_bank(b, turns, tables);
    const ScratchTables& scratch = tables.scratch;
    const PairTables& touching = tables.pairs;
    for (int side = 0; side < 2; ++side) {
        for (int64_t i = 0; i < scratch.count[0]; ++i)
            if (scratch.pulse[i].body[side] == b) turn_lanes(scratch.modal_impulse[i][side].data, turns);
        for (int64_t d = 0; d < scratch.count[1]; ++d)
            if (scratch.body(d, side) == b)
                for (double* gain : {scratch.gain0[d][side].data, scratch.gain1[d][side].data}) turn_lanes(gain, turns);
        for (int64_t i = 0; i < touching.count[0]; ++i)
            if (touching.pair[touching.active[i]].body[side] == b)
                turn_lanes(touching.gain[touching.active[i]][side].data, turns);
    }
    body.turns = 0;
    const Array<Turn, 1> rows = tables.table.turns.part(body.turn_at, body.turn_at + after.size());
    for (int64_t i = 0; i < after.size() && !free; ++i)
        if (!is_identity(after[i].by)) rows[body.turns++] = after[i];
    return true;
}

}  // namespace engine
