#include "strike_cause.hpp"

#include <algorithm>

#include "load_splitting.hpp"

namespace engine {

void set_gravity_steps(int64_t ahead, int64_t number, const PairTables& pairs, Array<const Body, 1> bodies,
                       Doubles gravity_steps) {
    for (int64_t b = 0; b < bodies.size(); ++b) gravity_steps[b] = 0.0;
    for (int64_t i = 0; i < pairs.count[0]; ++i) {
        const Pair& pair = pairs.pair[pairs.active[i]];
        for (int64_t column = NOW + ahead - STEPS; column < NOW + ahead; ++column)
            if (pair.force_n[column] > 0.0) gravity_steps[pair.body[0]] = gravity_steps[pair.body[1]] = 1.0;
    }
    for (int64_t b = 0; b < bodies.size(); ++b) {
        if (bodies[b].mass_kg <= 0.0) {
            gravity_steps[b] = 0.0;
        } else if (number - bodies[b].placed < SPAN) {
            gravity_steps[b] = SPAN;
        }
    }
}

bool is_recreated(Array<Body, 1> bodies, const int64_t (&pair)[2], double approach_m_s, double fall_m_s,
                  int64_t number) {
    const double e = std::min(bodies[pair[0]].rebound * bodies[pair[1]].rebound, 1.0);
    const double limit = 3.0 * std::max(1.0, e / std::max(1.0 - e, 1e-9));
    const double loss_m_s = fall_m_s * (1.0 - e) / (4.0 * std::max(e, 1e-9));  // a step
    const auto left_of = [&](double speed_m_s, int64_t step) {
        return speed_m_s - loss_m_s * static_cast<double>(std::max<int64_t>(number - step, 0));
    };
    double left_m_s = 0.0;
    bool recent = true;
    for (int64_t b : pair) {
        Body& body = bodies[b];
        if (!(body.mass_kg > 0.0)) continue;
        if (body.since_m_s > 0.0 && (number - body.cause_step) * fall_m_s >= 2.0 * body.cause_m_s) {
            body.cause_m_s = body.since_m_s, body.cause_step = body.since_step, body.since_m_s = 0.0;
        }
        left_m_s = std::max(left_m_s, left_of(body.cause_m_s, body.cause_step));
        recent = recent && number - body.loaded <= 2.0 * limit + 2.0;
    }
    if (recent && left_m_s < approach_m_s && approach_m_s <= limit * fall_m_s) return true;
    for (int64_t b : pair) {
        Body& body = bodies[b];
        if (approach_m_s >= left_of(body.cause_m_s, body.cause_step)) {
            body.cause_m_s = approach_m_s, body.cause_step = number, body.since_m_s = 0.0;
        } else if (approach_m_s >= left_of(body.since_m_s, body.since_step)) {
            body.since_m_s = approach_m_s, body.since_step = number;
        }
    }
    return false;
}

void accept_strikes(Array<Strike, 1> strikes, Array<const Body, 1> bodies, Doubles transmitted_n_s) {
    const int64_t count = strikes.size();
    for (int64_t q = 0; q < count; ++q) strikes[q].accepted_n_s = std::min(strikes[q].raw_n_s, strikes[q].budget_n_s);
    bool grown = true;
    for (int round = 0; grown && round < MOST_TRANSMISSIONS; ++round) {
        for (int64_t q = 0; q < count; ++q)
            for (int64_t b : strikes[q].body) transmitted_n_s[b] = 0.0;
        for (int64_t q = 0; q < count; ++q)
            for (int64_t b : strikes[q].body)
                if (bodies[b].mass_kg > 0.0) transmitted_n_s[b] = std::max(transmitted_n_s[b], strikes[q].accepted_n_s);
        grown = false;
        for (int64_t q = 0; q < count; ++q) {
            Strike& strike = strikes[q];
            const double most_n_s = std::max(transmitted_n_s[strike.body[0]], transmitted_n_s[strike.body[1]]);
            const double more_n_s = std::min(strike.raw_n_s, std::max(strike.budget_n_s, most_n_s));
            grown = grown || more_n_s != strike.accepted_n_s;
            strike.accepted_n_s = more_n_s;
        }
    }
}

}  // namespace engine
