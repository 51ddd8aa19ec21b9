#include "strike_forces.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "contact_place.hpp"
#include "hertz.hpp"
#include "load_splitting.hpp"
#include "octave_heights.hpp"
#include "pulse_shape.hpp"
#include "strike_cause.hpp"
#include "strike_timing.hpp"

namespace engine {

// Sum over a strike's rows, each weighted by the fraction of its step that is strike; no budget as yet.
static void sum_rows(Strike& strike, Array<const ContactRow, 1> rows) {
    for (int x = 0; x < 3; ++x) {
        strike.impulse_n_s[x] = strike.normal[x] = strike.centre_m[x] = 0.0;
        strike.arm_m[0][x] = strike.arm_m[1][x] = 0.0;
    }
    double raw_n_s = 0.0, approach_m_s = 0.0;
    for (int delay = 0; delay < STEPS; ++delay) {
        const double fraction = strike.fraction[delay];
        if (!(fraction > 0.0)) continue;
        for (int64_t r = strike.row[delay][0]; r < strike.row[delay][1]; ++r) {
            const ContactRow& row = rows[r];
            const double load_n_s = row.load_n_s * fraction;
            raw_n_s += load_n_s;
            approach_m_s = std::max(approach_m_s, row.approach_m_s);
            for (int x = 0; x < 3; ++x) {
                strike.impulse_n_s[x] += fraction * row.impulse_n_s[x];
                strike.normal[x] += load_n_s * row.normal[x];
                strike.centre_m[x] += load_n_s * row.point_m[0][x];
                for (int side = 0; side < 2; ++side) strike.arm_m[side][x] += load_n_s * row.arm_m[side][x];
            }
        }
    }
    strike.raw_n_s = raw_n_s, strike.approach_m_s = approach_m_s, strike.budget_n_s = 0.0;
    const double whole = std::max(raw_n_s, 1e-300);
    double square = 0.0;
    for (int x = 0; x < 3; ++x) {
        strike.normal[x] /= whole;
        strike.centre_m[x] /= whole;
        square += strike.normal[x] * strike.normal[x];
        for (int side = 0; side < 2; ++side) strike.arm_m[side][x] /= whole;
    }
    for (int x = 0; x < 3; ++x) strike.normal[x] /= std::max(std::sqrt(square), 1e-300);
}

// Return how many times as long a ball's pulse is by the waves that its patch covers, where they are stated.
// Of a preset's surface they would make it longer by 2 % at most, and are left out.
static double rough_stretch_of(Array<const Body, 1> bodies, const int64_t (&pair)[2], double mass_kg, double modulus_pa,
                               double curvature_per_m, double speed_m_s) {
    const double (&low_m)[OCTAVES] = bodies[pair[0]].octave_rms_m;
    const double (&high_m)[OCTAVES] = bodies[pair[1]].octave_rms_m;
    if (!(curvature_per_m > 0.0) || (low_m[0] < 0.0 && high_m[0] < 0.0)) return 1.0;
    const double depth_m = impact_depth_m(mass_kg, ball_stiffness(modulus_pa, 1.0 / curvature_per_m), speed_m_s);
    const double across_m = 2.0 * std::sqrt(depth_m / curvature_per_m);
    double square_m2 = 0.0;
    for (int j = 0; j < OCTAVES; ++j) {
        if (WAVE_M[j] < across_m) {
            const double low = std::max(low_m[j], 0.0), high = std::max(high_m[j], 0.0);
            square_m2 += low * low + high * high;
        }
    }
    return rough_stretch(mass_kg, modulus_pa, curvature_per_m, speed_m_s, PERSSON * std::sqrt(square_m2));
}

// Make a strike's pulse, but for its start, and its Uᵀj (2, columns); false where it is inaudible.
static bool make_pulse(const Strike& strike, Array<const double, 2> quaternion_xyzw, Array<ContactRow, 1> rows,
                       const BodyTables& table, Pulse& pulse, Array<double, 2> modal_impulse) {
    // an impact that changes the speed of its effective mass by less is ignored: a body of 10 cm sends 0 dB SPL to 1 m
    // then
    constexpr double least_jump_m_s = 1e-6;
    const Array<const Body, 1> bodies = table.bodies;
    const Body &low = bodies[strike.body[0]], &high = bodies[strike.body[1]];
    const double (&j)[3] = strike.impulse_n_s;
    const double raw_n_s = std::max(strike.raw_n_s, 1e-300), accepted_n_s = strike.accepted_n_s;
    const double mass_kg = effective_mass(bodies, strike.body, quaternion_xyzw, strike.arm_m, strike.normal);
    const bool active = low.modes + low.rigid + high.modes + high.rigid > 0;
    const bool steep = std::sqrt(j[0] * j[0] + j[1] * j[1] + j[2] * j[2]) > raw_n_s * STEEPEST;
    if (!active || steep || mass_kg <= 0.0 || !(accepted_n_s > least_jump_m_s * mass_kg)) return false;
    for (int side = 0; side < 2; ++side)
        for (int64_t c = 0; c < modal_impulse.shape[1]; ++c) modal_impulse(side, c) = 0.0;
    const double scale = accepted_n_s / raw_n_s;
    double most_n_s = -1.0, curvature_per_m = 0.0, spread_m2 = 0.0;
    for (int delay = 0; delay < STEPS; ++delay) {
        const double fraction = strike.fraction[delay];
        if (!(fraction > 0.0)) continue;
        for (int64_t r = strike.row[delay][0]; r < strike.row[delay][1]; ++r) {
            ContactRow& row = rows[r];
            find_contact_point(row, table);
            for (int side = 0; side < 2; ++side)
                add_modal_impulse(row, side, fraction * scale, table, modal_impulse[side].data);
            const double load_n_s = row.load_n_s * fraction;
            if (load_n_s > most_n_s)
                most_n_s = load_n_s, curvature_per_m = row.curvature_per_m[0] + row.curvature_per_m[1];
            for (int x = 0; x < 3; ++x) {
                const double off_m = row.point_m[0][x] - strike.centre_m[x];
                spread_m2 += load_n_s / raw_n_s * (off_m * off_m);
            }
        }
    }
    const double area_m2 = flat_area_m2(bodies, strike.body, std::sqrt(spread_m2), curvature_per_m, STRUCK_FLAT);
    const double known_m_s = strike.approach_m_s > 0.0 ? strike.approach_m_s : accepted_n_s / (1.5 * mass_kg);
    const double speed_m_s = std::max(known_m_s, 1e-6);
    const double modulus_pa = contact_modulus(low.modulus_pa, high.modulus_pa);
    auto [length_s, flat] = pulse_length(mass_kg, modulus_pa, curvature_per_m, area_m2, speed_m_s);
    if (!flat) length_s *= rough_stretch_of(bodies, strike.body, mass_kg, modulus_pa, curvature_per_m, speed_m_s);
    double given = 0.0;
    for (int side = 0; side < 2; ++side) {
        const Body& body = bodies[strike.body[side]];
        turn_modal_impulse(body, table.turns, modal_impulse[side].data);
        given += compliance(modal_impulse[side].data, table.frequency_hz.data + body.frequency_at, body.modes, length_s,
                            table.spectrum[flat]);
        pulse.body[side] = strike.body[side];
    }
    pulse.length_s = length_s, pulse.flat = flat;
    // the square of an impulse below 1e-162 N·s is zero; it is inaudible
    const double square = accepted_n_s * accepted_n_s;
    pulse.transmitted_fraction = square > 0.0 ? 1.0 / (1.0 + mass_kg * given / square) : 1.0;
    for (int x = 0; x < 3; ++x) pulse.impulse_n_s[x] = scale * j[x];
    return true;
}

// Set what the strikes' approaches can cause; return whether any can cause something.
static bool set_budgets(Array<Strike, 1> strikes, int64_t number, const Window& here, double back_s,
                        Array<const double, 2> quaternion_xyzw, Array<const ContactRow, 1> rows, Array<Body, 1> bodies,
                        Array<const double, 1> gravity_steps) {
    const double (&g)[3] = here.gravity_m_s2;
    const double gravity_m_s = std::sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) * here.dt_s;
    bool caused = false;
    for (int64_t q = 0; q < strikes.size(); ++q) {
        Strike& strike = strikes[q];
        sum_rows(strike, rows);
        date_by_gap(strike, rows, back_s, here.dt_s);
        const double (&n)[3] = strike.normal;
        // a tenth for a solver's remainder, a hundredth in every direction for wedged bodies
        const double fall_m_s =
            1.1 * std::fabs(n[0] * g[0] + n[1] * g[1] + n[2] * g[2]) * here.dt_s + 0.01 * gravity_m_s;
        const double steps = std::max(gravity_steps[strike.body[0]], gravity_steps[strike.body[1]]);
        const double speed_m_s = std::max(strike.approach_m_s - steps * fall_m_s, 0.0);
        if (speed_m_s > 0.0 && !is_recreated(bodies, strike.body, strike.approach_m_s, fall_m_s, number)) {
            strike.budget_n_s = 2.0 * effective_mass(bodies, strike.body, quaternion_xyzw, strike.arm_m, n) * speed_m_s;
            caused = true;
        }
    }
    return caused;
}

int64_t find_pulses(int64_t ahead, int64_t number, int64_t found, const WindowTables& window, const BodyTables& table,
                    const PairTables& pairs, Array<Strike, 1> strikes, const ScratchTables& scratch,
                    ContactScratch& memory) {
    const Array<Body, 1> bodies = table.bodies;
    const Window& here = window.step[number % SPAN];
    const Array<const double, 2> quaternion_xyzw = window.quaternion_xyzw[number % SPAN];
    // none comes before step 0: as if it had been as long
    const double back_s = number > 0 ? window.step[(number + SPAN - 1) % SPAN].dt_s : here.dt_s;
    for (int64_t i = 0; i < pairs.count[0]; ++i) {
        const Pair& pair = pairs.pair[pairs.active[i]];
        if (pair.force_n[NOW + ahead - 1] > 0.0)
            for (int64_t b : pair.body) bodies[b].loaded = std::max(bodies[b].loaded, number - 1);
    }
    const int64_t count = split_loads(ahead, number, window, pairs, strikes);
    if (count == 0) return found;
    strikes = strikes.part(0, count);
    Doubles gravity_steps = room(memory.gravity_steps, bodies.size());
    set_gravity_steps(ahead, number, pairs, bodies, gravity_steps);
    if (!set_budgets(strikes, number, here, back_s, quaternion_xyzw, window.row, bodies, gravity_steps)) return found;
    accept_strikes(strikes, bodies, room(memory.transmitted_n_s, bodies.size()));
    for (int64_t q = 0; q < count; ++q) {
        Strike& strike = strikes[q];
        strike.pulse = -1, strike.length_s = 0.0;
        if (!(strike.accepted_n_s > 0.0)) continue;
        Pulse& pulse = scratch.pulse[found];
        if (make_pulse(strike, quaternion_xyzw, window.row, table, pulse, scratch.modal_impulse[found]))
            strike.pulse = found++, strike.length_s = pulse.length_s;
    }
    date_others(strikes, bodies, back_s, here.dt_s, memory);
    set_starts(strikes, scratch.pulse, ahead, back_s, here.dt_s);
    return found;
}

}  // namespace engine
