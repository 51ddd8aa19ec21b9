#include "turned_modes.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace engine {

namespace {

// Largest element, in radians about, of a turn that is left out: cos² of it is 1 within 0.3 %.
constexpr double SAME_TURN = 0.05;

struct PairTurn {
    int64_t mode;  // and the next
    double by[2][2];
};

using Turns = std::vector<PairTurn>;

// The part of a turn, (0, 0) for the identity, that mixes a mode and the next; whether it does.
bool read_pair(Array<const double, 2> turn, int64_t mode, double (&part)[2][2]) {
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2; ++j) part[i][j] = turn.size() ? turn(mode + i, mode + j) : (i == j ? 1.0 : 0.0);
    return part[0][1] != 0;
}

void turn_lanes(double* lanes, const Turns& turns) {
    for (const PairTurn& turn : turns) {
        const double one = lanes[turn.mode], other = lanes[turn.mode + 1];
        lanes[turn.mode] = one * turn.by[0][0] + other * turn.by[1][0];
        lanes[turn.mode + 1] = one * turn.by[0][1] + other * turn.by[1][1];
    }
}

void turn_bank(int64_t b, const Turns& turns, const ModeTables& tables) {
    const BankTables& bank = tables.bank;
    const int64_t modes = bank.law.shape[1], start = bank.body[b].start;
    for (const int64_t part : {start, modes + start}) {
        turn_lanes(bank.z.data + part, turns);
        turn_lanes(bank.driven.data + part, turns);
        for (const Array<double, 2>& weight : {tables.weight, tables.transmission_weight})
            for (int64_t w = 0; w < weight.shape[0]; ++w) turn_lanes(weight[w].data + part, turns);
    }
    for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next)
        for (int row = 0; row < 2; ++row) turn_lanes(bank.rows[slot][row].data, turns);  // r, which holds the gain
}

}  // namespace

bool turn_modes(int64_t b, Array<const int64_t, 1> pairs, Array<const double, 2> before, Array<const double, 2> after,
                const ModeTables& tables) {
    Turns turns;
    double largest = 0;
    for (int64_t i = 0; i < pairs.size(); ++i) {
        PairTurn turn{pairs[i], {}};
        double old[2][2], made[2][2];
        const bool mixed = read_pair(before, turn.mode, old), mixes = read_pair(after, turn.mode, made);
        if (!mixed && !mixes) continue;
        for (int j = 0; j < 2; ++j)
            for (int k = 0; k < 2; ++k) {
                turn.by[j][k] = old[0][j] * made[0][k] + old[1][j] * made[1][k];
                largest = std::max(largest, std::fabs(turn.by[j][k] - (j == k ? 1.0 : 0.0)));
            }
        if (turn.by[0][1] != 0) turns.push_back(turn);
    }
    if (turns.empty() || (after.size() && largest < SAME_TURN)) return false;
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
    return true;
}

}  // namespace engine
