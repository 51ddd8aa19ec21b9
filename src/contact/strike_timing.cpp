#include "strike_timing.hpp"

#include <algorithm>

#include "strike_cause.hpp"

namespace engine {

void date_by_gap(Strike& strike, Array<const ContactRow, 1> rows, double back_s, double dt_s) {
    double most = 0.0;
    strike.dated = 0, strike.overlaps = 0;
    for (int64_t r = strike.row[0][0]; r < strike.row[0][1]; ++r) {
        const ContactRow& row = rows[r];
        const double load_n_s = row.load_n_s * strike.fraction[0], speed_m_s = row.approach_m_s;
        if (row.gap_m < 0.0) strike.overlaps = 1;
        if (load_n_s * speed_m_s > most && row.gap_m != 0.0) {
            const double meets_s = row.gap_m / speed_m_s;
            if (-back_s <= meets_s && meets_s <= dt_s)
                most = load_n_s * speed_m_s, strike.meets_s = meets_s, strike.dated = 1;
        }
    }
}

// Date a strike that is not dated by the phase of its lower body that moves.
static void spread_strike(Strike& strike, Array<Body, 1> bodies, double back_s, double dt_s) {
    if (strike.dated) return;
    Body& body = bodies[bodies[strike.body[0]].mass_kg > 0.0 ? strike.body[0] : strike.body[1]];
    const double phase = phase_in_step(body.surface_seed, body.undated_strikes);
    strike.meets_s = strike.overlaps ? (phase - 1.0) * back_s : phase * dt_s;
    strike.dated = 1;
    ++body.undated_strikes;
}

void date_others(Array<Strike, 1> strikes, Array<Body, 1> bodies, double back_s, double dt_s, ContactScratch& memory) {
    const int64_t count = strikes.size();
    Doubles strongest_n_s = room(memory.transmitted_n_s, bodies.size()), when_s = room(memory.when_s, bodies.size());
    for (int64_t q = 0; q < count; ++q)
        if (strikes[q].accepted_n_s > 0.0 && strikes[q].accepted_n_s <= strikes[q].budget_n_s)
            spread_strike(strikes[q], bodies, back_s, dt_s);
    bool grown = true;
    for (int round = 0; grown && round < MOST_TRANSMISSIONS; ++round) {
        grown = false;
        for (int64_t q = 0; q < count; ++q)
            for (int64_t b : strikes[q].body) strongest_n_s[b] = 0.0;
        for (int64_t q = 0; q < count; ++q) {
            const Strike& strike = strikes[q];
            for (int64_t b : strike.body)
                if (strike.dated && bodies[b].mass_kg > 0.0 && strike.accepted_n_s > strongest_n_s[b])
                    strongest_n_s[b] = strike.accepted_n_s, when_s[b] = strike.meets_s + 0.5 * strike.length_s;
        }
        for (int64_t q = 0; q < count; ++q) {
            Strike& strike = strikes[q];
            const int64_t (&pair)[2] = strike.body;
            const int64_t b = strongest_n_s[pair[0]] >= strongest_n_s[pair[1]] ? pair[0] : pair[1];
            if (!strike.dated && strike.accepted_n_s > 0.0 && strongest_n_s[b] > 0.0)
                strike.meets_s = when_s[b], strike.dated = 1, grown = true;
        }
    }
    for (int64_t q = 0; q < count; ++q)
        if (strikes[q].accepted_n_s > 0.0) spread_strike(strikes[q], bodies, back_s, dt_s);
}

void set_starts(Array<const Strike, 1> strikes, Array<Pulse, 1> pulses, int64_t ahead, double back_s, double dt_s) {
    for (int64_t q = 0; q < strikes.size(); ++q) {
        if (strikes[q].pulse < 0) continue;
        const double meets_s = strikes[q].meets_s;
        const double late_s = ahead || meets_s >= 0.0 ? 0.0 : back_s;
        Pulse& pulse = pulses[strikes[q].pulse];
        pulse.start_s = std::min(meets_s + late_s, dt_s), pulse.ahead = ahead;
    }
}

double phase_in_step(int64_t seed, int64_t count) {
    constexpr double golden_section = 0.6180339887498949;
    const double phase = seed / 4294967296.0 + golden_section * count;
    return EDGE_MARGIN + (1.0 - 2.0 * EDGE_MARGIN) * (phase - static_cast<int64_t>(phase));
}

}  // namespace engine
