#include "strike_pool.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../contact/pulse_shape.hpp"
#include "../math/elementary.hpp"
#include "drive.hpp"
#include "translation.hpp"

namespace engine {

namespace {

// The force at a fraction of the pulse, mean 1, and 0 outside [0, 1].
double pulse_force(double fraction, bool flat) {
    constexpr double pi = std::numbers::pi;
    if (!(0.0 <= fraction && fraction <= 1.0)) return 0.0;
    if (flat) return 0.5 * pi * sin(pi * fraction);
    const double* force = pulse_table().force;
    const double place = fraction * PULSE_CELLS;
    const int64_t i = std::min<int64_t>(static_cast<int64_t>(place), PULSE_CELLS - 1);
    return force[i] + (place - static_cast<double>(i)) * (force[i + 1] - force[i]);
}

int64_t rounded_up(double value) {
    return static_cast<int64_t>(std::ceil(value));
}

int64_t rounded_down(double value) {
    return static_cast<int64_t>(std::floor(value));
}

// Compute all that a strike adds to its body's modes. Nodes at one place between samples count as one; of a pulse too
// short for all of these places those of its first sample stand apart from those of the next.
void sum_nodes(int64_t slot, int64_t b, const BankTables& bank) {
    const BankStrike& strike = bank.strikes[slot];
    double impulse[NODES_PER_PULSE + 8] = {};
    const int64_t whole = strike.whole, count = strike.count, within = strike.within;
    const bool folds = count >= whole;
    const int64_t places = folds ? whole : count;
    for (int64_t i = 0; i < count; ++i) {
        const double fraction = ((static_cast<double>(i) + 0.5) * strike.spacing - strike.ahead) / strike.length;
        const int64_t place = folds ? (i + whole - within % whole) % whole : i;  // the last one acts at a sample's end
        impulse[place] += pulse_force(fraction, strike.flat != 0) / strike.force_sum;
    }
    const int64_t first = folds ? places : within;
    const double late = strike.phase + 1.0 - static_cast<double>(places - first) * strike.spacing;
    const NodeGroup groups[2] = {{impulse, first, strike.phase}, {impulse + first, places - first, late}};
    const int64_t start = bank.body[b].start;
    drive().sum_strike(bank.rows[slot].data, bank.rows.shape[2], bank.law.data + start, bank.law.shape[1],
                       bank.body[b].stop - start, groups);
}

// Divide the pulse into cells of the sample grid, with a node in the middle of each.
void enter_nodes(int64_t slot, int64_t b, int64_t at, const BodyPulse& pulse, const BankTables& bank) {
    constexpr double at_once =
        1e-3;  // samples: a shorter pulse acts whole at the first sample that any of it has come to
    BankStrike& strike = bank.strikes[slot];
    int64_t whole, count, first, within;
    double delta, edge;
    if (strike.length > at_once) {
        whole = std::max(NODES_PER_SAMPLE, rounded_up(NODES_PER_PULSE / strike.length));
        const int64_t begin = rounded_down(strike.start * static_cast<double>(whole));
        count = rounded_up((strike.start + strike.length) * static_cast<double>(whole)) - begin;
        delta = 1.0 / static_cast<double>(whole), edge = static_cast<double>(begin) / static_cast<double>(whole);
        first = std::max(rounded_up(edge + 0.5 * delta), at);
        within = std::min(first * whole - begin, count) - 1;
    } else {
        count = NODES_PER_PULSE, edge = strike.start;
        delta = strike.length / static_cast<double>(count);
        whole = rounded_down(1.0 / delta), within = count - 1;
        first = std::max(rounded_up(edge + 0.5 * delta), at);
    }
    strike.ahead = strike.start - edge;
    double sum = 0;
    for (int64_t i = 0; i < count; ++i)
        sum += pulse_force(((static_cast<double>(i) + 0.5) * delta - strike.ahead) / strike.length, strike.flat != 0);
    const double phase =
        std::max((static_cast<double>(first) - (edge + 0.5 * delta)) - static_cast<double>(within) * delta, 0.0);
    strike.count = count, strike.spacing = delta, strike.whole = whole, strike.force_sum = sum;
    strike.first = first, strike.within = within + 1, strike.upcoming = 0, strike.phase = phase;
    const int64_t start = bank.body[b].start, lanes = bank.body[b].stop - start;
    const double times[4] = {phase, delta, 1.0 - static_cast<double>(whole) * delta,
                             1.0 - static_cast<double>(whole + 1) * delta};
    drive().phasors(bank.rows[slot].data, bank.rows.shape[2], bank.law.data + start, bank.law.shape[1], lanes,
                    pulse.gain, pulse.fraction, times);
    sum_nodes(slot, b, bank);
}

// The first sample whose middle half before or after it has anything of the pulse.
int64_t first_near(const BankStrike& strike) {
    return rounded_up(strike.start - 0.5);
}

// Put a strike behind those of its body that start before it or with it.
void link(int64_t slot, int64_t b, const BankTables& bank) {
    int64_t before = -1, after = bank.ringing[b].strike;
    while (after >= 0 && bank.strikes[after].start <= bank.strikes[slot].start) {
        before = after;
        after = bank.strikes[after].next;
    }
    bank.strikes[slot].next = after;
    (before < 0 ? bank.ringing[b].strike : bank.strikes[before].next) = slot;
}

}  // namespace

bool enter_strike(int64_t b, const BodyPulse& pulse, int64_t at, const BankTables& bank) {
    bool modal = false, rigid = false;
    for (int64_t k = 0; k < bank.body[b].columns; ++k)
        modal = modal || std::fabs(pulse.gain[k] * pulse.fraction) >= FLUSH;
    if (bank.body[b].rigid) rigid = pulse.impulse_n_s[0] != 0 || pulse.impulse_n_s[1] != 0 || pulse.impulse_n_s[2] != 0;
    if (!(modal || rigid)) return true;
    int64_t& free = bank.free[0];
    if (free == 0) return false;
    const int64_t slot = bank.free[free--];
    BankStrike& strike = bank.strikes[slot];
    strike.start = pulse.start, strike.length = std::max(pulse.length, SHORTEST_PULSE);
    strike.flat = pulse.flat, strike.modal = modal, strike.rigid = rigid;
    if (modal) enter_nodes(slot, b, at, pulse, bank);
    if (rigid) {
        enter_cells(strike, bank.body[b]);
        for (int axis = 0; axis < 3; ++axis) strike.rigid_impulse_n_s[axis] = pulse.fraction * pulse.impulse_n_s[axis];
    }
    link(slot, b, bank);
    return true;
}

int64_t enter_pulses(double begin_s, double after_s, int64_t at, double sr, const BankTables& bank,
                     const ScratchTables& scratch) {
    const int64_t count = scratch.count[0];
    for (int64_t i = 0; i < count; ++i) {
        if (bank.free[0] < 2) return i;
        const Pulse& pulse = scratch.pulse[i];
        const double begin_of_step_s = pulse.ahead ? after_s : begin_s;
        const double start = std::max((begin_of_step_s + pulse.start_s) * sr, static_cast<double>(at));
        for (int side = 0; side < 2; ++side) {
            const double sign = side == 0 ? 1.0 : -1.0;
            const double (&j)[3] = pulse.impulse_n_s;
            const BodyPulse one{start,
                                pulse.length_s * sr,
                                pulse.flat != 0,
                                pulse.transmitted_fraction,
                                scratch.modal_impulse[i][side].data,
                                {sign * j[0], sign * j[1], sign * j[2]}};
            enter_strike(pulse.body[side], one, at, bank);
        }
    }
    return count;
}

void release_done_strikes(int64_t b, const BankTables& bank) {
    int64_t before = -1, slot = bank.ringing[b].strike;
    while (slot >= 0) {
        const int64_t after = bank.strikes[slot].next;
        if (bank.strikes[slot].modal || bank.strikes[slot].rigid) {
            before = slot;
        } else {
            (before < 0 ? bank.ringing[b].strike : bank.strikes[before].next) = after;
            bank.free[++bank.free[0]] = slot;
        }
        slot = after;
    }
}

bool has_nodes_before(int64_t b, int64_t end, const BankTables& bank) {
    for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next)
        if (bank.strikes[slot].modal && std::min(bank.strikes[slot].first, first_near(bank.strikes[slot])) < end)
            return true;
    return false;
}

void send_strikes(int64_t b, const Stretch& stretch, const double* weight, const BankTables& bank, double* out) {
    const int64_t at = stretch.at + stretch.i, width = bank.rows.shape[2];
    const int64_t lanes = bank.body[b].stop - bank.body[b].start;
    for (int64_t slot = bank.ringing[b].strike; slot >= 0; slot = bank.strikes[slot].next) {
        const BankStrike& strike = bank.strikes[slot];
        const double end = strike.start + strike.length + 0.5;
        const int64_t first = std::max<int64_t>(first_near(strike) - at, 0);
        if (!strike.modal || first >= stretch.count || end <= static_cast<double>(at + first)) continue;
        const double* whole = bank.rows[slot].data + 8 * width;
        const double sent = drive().lasting_strike(weight, bank.law.shape[1], whole, whole + width, lanes);
        const auto acted = [&](int64_t n) {
            return cumulated((static_cast<double>(at + n) - 0.5 - strike.start) / strike.length, strike.flat != 0);
        };
        double before = acted(first);
        for (int64_t k = first; k < stretch.count; ++k) {
            const double after = acted(k + 1);
            out[k] += sent * (after - before);
            before = after;
        }
    }
}

NodeSpan plan_nodes(int64_t slot, int64_t at, int64_t count, const BankTables& bank, NodePlan* plan, double* due,
                    bool final) {
    BankStrike& strike = bank.strikes[slot];
    int64_t upcoming = strike.upcoming;
    double phase = strike.phase;
    const int64_t begin = std::max<int64_t>(strike.first - at, 0);
    int64_t k = begin;
    for (; k < count && upcoming < strike.count; ++k) {
        int64_t nodes;
        if (at + k == strike.first) {
            nodes = strike.within;
            plan[k].turn = -1;
        } else {
            nodes = std::min(std::max(rounded_down((phase + 1.0) / strike.spacing), strike.whole), strike.whole + 1);
            phase += 1.0 - static_cast<double>(nodes) * strike.spacing;
            plan[k].turn = nodes - strike.whole;
        }
        const int64_t real = std::min(nodes, strike.count - upcoming);
        plan[k].nodes = real;
        plan[k].empty = nodes - real;
        for (int64_t i = upcoming; i < upcoming + real; ++i) {
            const double fraction = ((static_cast<double>(i) + 0.5) * strike.spacing - strike.ahead) / strike.length;
            *due++ = pulse_force(fraction, strike.flat != 0) / strike.force_sum;
        }
        upcoming += real;
    }
    if (final) {
        strike.upcoming = upcoming, strike.phase = phase;
        strike.modal = upcoming < strike.count ? 1 : 0;
    }
    return {begin, k};
}

}  // namespace engine
