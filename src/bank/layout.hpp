// Tables of the bank and the numbers that its stages share.
//
//     BankBody    a body: its lanes in the flat arrays, and the pole that its three translations share
//     Ringing     its activity: flags, the translations' state, the first of its strikes
//     BankStrike  a pulse under way: a pool of rows, those of a body linked in order of start, then of arrival
//
// Modes of all bodies lie in flat arrays, a body's columns (audible modes, then the lines of its residual) in whole
// groups of LANE_PAIR lanes; spare lanes are zero. m lanes of all bodies:
//     law (7, m)                       decay and turn a sample (s = -d/sr + iω/sr), d/ω, bend, damping growth, its
//                                      power, and the contact separation
//     z, driven, pole, block (2·m,)    real parts first. z: free state at the next block's start; driven: what was
//                                      driven since this block's; pole = e^s, block = e^{256 s}, both bent by level
//                                      where a body is
#pragma once

#include <cstdint>
#include <vector>

#include "../array.hpp"
#include "../flush.hpp"
#include "../groups.hpp"
#include "../row_fields.hpp"
#include "../tables.hpp"
#include "../vector_level.hpp"

namespace engine {

constexpr int64_t LANE_PAIR = 2 * LANES;  // lanes driven side by side: either half hides the other's latency
constexpr int64_t DRIVEN =
    32;  // samples driven at a time, on the grid of absolute time; driven modes keep their bent poles as long
constexpr int64_t COLUMNS = 64;    // lanes of a body driven at a time: their impulses stay in the first cache
constexpr int64_t MOST_DUE = 128;  // nodes of one strike in DRIVEN samples: 24 in all, or two a sample and a few

constexpr int64_t TILE_ROW = 16;  // samples of a row of a block's tile
constexpr int64_t TILE_ROWS = 16;
constexpr int64_t BLOCK = TILE_ROW * TILE_ROWS;  // samples of free ringing at a time, on the grid of absolute time
constexpr int64_t CHUNK = 32;                    // modes that ring at a time

// Modes with |z| below this (in √J·√2) are set to zero: ½|z|² = 5e-31 J is 1e-10 of the mode's thermal energy kT at
// 300 K.
constexpr double FLOOR = 1e-15;

// The bank and its state: attributes of `instrument.Bank` (body … aims) and of `instrument.BankState`. b bodies, m
// lanes, W weight sets, D aimed ones, J partners of each body.
struct BankTables {
    Array<const BankBody, 1> body;
    Array<double, 2> weight;        // (W, 2·m), real parts first
    Array<const bool, 2> observed;  // (W, b) whether any weight of the body is not zero
    Array<const int64_t, 1> aims;   // (W,) pair of rows of aim that a set has in place of its weights, -1 for none
    Array<const bool, 1> radiates;  // (W,) sets of pressure, to which a force that lasts sends nothing: `lasting`
    Array<Ringing, 1> ringing;
    Array<double, 2> law;  // (7, m)
    Doubles z;
    Doubles driven;
    Array<double, 3> sound;  // (W, b, BLOCK) the block's free ringing
    Doubles pole;
    Doubles block;
    Array<double, 2> coming;               // (8, m) poles from the next block on, see `take_coming`
    Array<Transmission, 2> transmissions;  // (b, J)
    Array<double, 2> transmission_weight;  // (J·W, 2·m)
    Array<double, 3> transmission_sound;   // (J·W, b, BLOCK)
    Array<double, 2> aim;                  // (2·D, 2·m) weights of aimed sets as they are, and from the next block on
    Array<int64_t, 2> turned;              // (D, b) 1 where these differ
    Array<double, 2> blend;                // (D, BLOCK) scratch
    Array<BankStrike, 1> strikes;          // the pool
    Array<double, 3> rows;                 // (pool, 10, columns) phasors of its strikes, and their whole
    Integers free;                         // (pool + 1,) how many rows are free, then their numbers
};
GROUP_FIELDS(BankTables, body, weight, observed, aims, radiates, ringing, law, z, driven, sound, pole, block, coming,
             transmissions, transmission_weight, transmission_sound, aim, turned, blend, strikes, rows, free)

// Whether anything of a body's modes is active.
inline bool is_active(const Ringing& now) {
    return now.ringing || now.driven || now.tiled || now.strike >= 0;
}

// What a strike does at one sample.
struct NodePlan {
    int64_t turn;   // of its phasors: 0 by E0, 1 by E1, -1 by none
    int64_t nodes;  // that act
    int64_t empty;  // places behind the last of all
};

// Scratch of a call of the bank. Its owner keeps it, and makes room before a step.
struct BankWork {
    std::vector<int64_t> first;        // (b + 1,) where each body's forces begin in side
    std::vector<int64_t> side;         // (2·d,) 2·drive + side of each
    std::vector<double> signal;        // (d, 2, stride) impulses of the forces at both ends of the gains, 0 behind
    std::vector<double> axis_impulse;  // (6, stride) of a translation
    std::vector<double> lasting;       // (columns,) what a force that lasts would send by each mode
    alignas(64) double now[2 * CHUNK];
    alignas(64) double powers[10 * CHUNK];
    alignas(64) double table[2 * TILE_ROW * CHUNK];
    alignas(64) double column[2 * TILE_ROWS * CHUNK];
    alignas(64) double impulse[COLUMNS * DRIVEN * 2];
    alignas(64) double push[COLUMNS * DRIVEN];
    alignas(64) double partial[DRIVEN * LANES];
    alignas(64) double total[DRIVEN];
    alignas(64) double direct[DRIVEN];
    alignas(64) double due[MOST_DUE];
    NodePlan plan[DRIVEN];

    // Make room for calls of so many bodies, drives, samples and columns.
    void make_room(int64_t bodies, int64_t drives, int64_t samples, int64_t columns);
};

// Samples at + i … at + i + count - 1 of a call that begins at sample ``at``, within one of the DRIVEN or one block.
struct Stretch {
    int64_t at;
    int64_t i;
    int64_t count;
};

}  // namespace engine
