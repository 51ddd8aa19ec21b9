#include "pole_updates.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../bank/poles.hpp"
#include "../bank/transmission.hpp"
#include "../contact/coupling/motion_poles_vector.hpp"
#include "../contact/coupling/turned_modes.hpp"

namespace engine {

namespace {

constexpr int64_t RIGID = 6;           // rigid motions of a body, behind its modes
constexpr double FASTEST_TURN = 3.0;   // radians a sample: beyond, a mode is too fast to play
constexpr double SLOWEST_TURN = 1e-6;  // and below it stands still
constexpr double LARGEST = std::numeric_limits<double>::max();
// Of a mode's own weight: a weaker transmission would add 0.4 dB to it, and is left out.
constexpr double LEAST_TRANSMITTED = 0.3;
// Of a body's loudest mode: 60 dB below, it is what is left when all else has decayed.
constexpr double FAINTEST = 1e-3;

Array<const int64_t, 1> pairs_of(int64_t b, const PoleTables& poles) {
    const Mobility& one = poles.mobility[b];
    return poles.pair.part(one.pair_at, one.pair_at + one.pairs);
}

// List the pairs of body b that touch, as places and columns of the partner; return the number of their touches.
int64_t list_touches(int64_t b, const ContactState& state, PoleWork& work) {
    CoupledBody& body = work.body;
    work.places.clear(), work.begin.clear(), body.partners.clear();
    int64_t touches = 0;
    const TouchSides& sides = state.poles.sides;
    for (int64_t i = 0; i < state.pairs.count[0]; ++i) {
        const int64_t place = state.pairs.active[i], count = state.pairs.patch[place].count;
        const Pair& pair = state.pairs.pair[place];
        if ((pair.body[0] != b && pair.body[1] != b) || count == 0) continue;
        const int64_t other = pair.body[0] + pair.body[1] - b;
        if (!(sides.compliance_per_pa[other] + sides.compliance_per_pa[b] > 0)) continue;  // both are rigid
        const auto known = std::find(body.partners.begin(), body.partners.end(), other);
        work.places.push_back(place);
        work.begin.push_back(known - body.partners.begin());  // its number among them, at first
        if (known == body.partners.end()) body.partners.push_back(other);
        touches += count;
    }
    return touches;
}

// Write λ = ω² + d² and d of a body's modes and rigid motions to their ends.
void add_motions(const Mobility& one, const PoleTables& poles, std::vector<double>& lam, std::vector<double>& decay) {
    for (int64_t k = one.mode_at; k < one.mode_at + one.modes; ++k) {
        const double omega = poles.omega_rad_s[k], own = poles.decay_per_s[k];
        lam.push_back(omega * omega + own * own), decay.push_back(own);
    }
    lam.insert(lam.end(), RIGID, 0.0), decay.insert(decay.end(), RIGID, 0.0);
}

// Keep the springs that are not 0: rows of own and other, and which direction each is of all touches.
int64_t keep_springs(int64_t own, int64_t other, PoleWork& work) {
    std::vector<std::complex<double>>& spring = work.body.spring;
    const auto rows = static_cast<int64_t>(spring.size());
    work.direction.clear();
    for (int64_t c = 0; c < rows; ++c) {
        if (spring[c] == 0.0) continue;
        const auto kept = static_cast<int64_t>(work.direction.size());
        work.direction.push_back(c);
        if (kept == c) continue;
        spring[kept] = spring[c];
        std::copy_n(&work.own[c * own], own, &work.own[kept * own]);
        std::copy_n(&work.other[c * other], other, &work.other[kept * other]);
    }
    std::fill(spring.begin() + static_cast<int64_t>(work.direction.size()), spring.end(), 0.0);
    return static_cast<int64_t>(work.direction.size());
}

// Make room for the poles of m modes at r springs of c touches, with so many pairs and partners' modes.
void fit_poles(int64_t m, int64_t r, int64_t c, int64_t pairs, int64_t partner_modes, PoleWork& work) {
    const int64_t sizes[] = {m, m, m * m, 3 * m, 2 * r * m, 2 * partner_modes * m, c * m};
    int64_t total = 0;
    for (const int64_t size : sizes) total += size;
    work.numbers.resize(total), work.newton.resize(m), work.turn.resize(pairs);
    double* at[std::size(sizes)];
    at[0] = work.numbers.data();
    for (size_t i = 1; i < std::size(sizes); ++i) at[i] = at[i - 1] + sizes[i - 1];
    work.body.poles = {{at[0], {m}},
                       {at[1], {m}},
                       {work.turn.data(), {pairs}},
                       {at[2], {m, m}},
                       {at[3], {m, 3}},
                       {reinterpret_cast<bool*>(work.newton.data()), {m}},
                       {at[4], {2, r, m}},
                       {at[5], {2, partner_modes, m}}};
    work.body.force_n_s = {at[6], {c, m}};
}

// Set the poles of its modes, its lines and rigid motions.
void set_body_poles(int64_t b, double sr, const ContactState& state, PoleWork& work) {
    const Mobility& one = state.poles.mobility[b];
    const BankBody& lanes = state.bank.body[b];
    const CoupledBody& body = work.body;
    work.step.resize(lanes.columns), work.separation.assign(lanes.columns, 0.0);
    const auto free = [&](int64_t k) {
        return Complex{state.poles.free_law(0, lanes.start + k), state.poles.free_law(1, lanes.start + k)};
    };
    for (int64_t k = 0; k < lanes.columns; ++k) work.step[k] = free(k);
    if (!body.touches) {
        set_poles(b, {work.step.data(), {lanes.columns}}, {nullptr, {0}}, state.poles.free_law, state.bank);
        return;
    }
    for (int64_t k = 0; k < one.modes; ++k)
        work.step[k] = limit_pole({-body.poles.decay_per_s[k] / sr, body.poles.omega_rad_s[k] / sr}, free(k));
    for (int64_t i = 0; i < one.follows; ++i) {
        const int64_t mode = state.poles.follow[one.follow_at + i];
        Complex& line = work.step[one.modes + i];
        line.re += work.step[mode].re - free(mode).re, line.im += work.step[mode].im - free(mode).im;
    }
    for (int64_t c = 0; c < body.touches; ++c)
        for (int64_t k = 0; k < one.modes; ++k) {
            const double part = body.force_n_s(c, k) / body.load_n[c];
            if (part > work.separation[k]) work.separation[k] = std::min(part, LARGEST);
        }
    set_poles(b, {work.step.data(), {lanes.columns}}, {work.separation.data(), {lanes.columns}}, state.poles.free_law,
              state.bank);
}

double size_of(Complex z) {
    return std::sqrt(z.re * z.re + z.im * z.im);
}

// Turn weights (m,) to a quarter of a turn from the body's own (m,). Which sign a mode's mean over all directions has is
// anyone's: of one sign what partner and body send by one mode would add, of the other cancel. Their maps do neither on
// the mean: |p|² is that of both.
void quarter_turn(const std::vector<Complex>& own, int64_t m, Complex* weight) {
    for (int64_t k = 0; k < m; ++k) {
        const double size = size_of(weight[k]), of = size_of(own[k]);
        weight[k] = of > 0 ? Complex{-own[k].im / of * size, own[k].re / of * size} : Complex{0.0, size};
    }
}

// Compute weights (W, columns) of the body's modes in the sound of its partner i into work.weight.
void weigh_partner(size_t i, int64_t columns, int64_t sets, const ContactState& state, PoleWork& work) {
    const CoupledBody& body = work.body;
    const MotionPoles& poles = body.poles;
    const Mobility& partner = state.poles.mobility[body.partners[i]];
    const int64_t m = poles.omega_rad_s.size(), first = body.partner_mode[i], count = partner.modes;
    const auto combine = motion_loops().combine;
    work.weight.assign(sets * columns, Complex{0, 0});
    work.row.resize(2 * count + 6 * m);
    double *real = work.row.data(), *imaginary = real + count;
    double *sum[4], *moved[2] = {imaginary + count + 4 * m, imaginary + count + 5 * m};
    for (int part = 0; part < 4; ++part) sum[part] = imaginary + count + part * m;
    for (int64_t w = 0; w < sets; ++w) {
        for (int64_t k = 0; k < count; ++k) {
            const Complex own = state.poles.weight[partner.weight_at + w * count + k];
            const double by = w == 0 ? 1.0 / state.poles.omega_rad_s[partner.mode_at + k] : 1.0;
            real[k] = own.re * by, imaginary[k] = own.im * by;
        }
        for (int part = 0; part < 4; ++part)
            combine({part < 2 ? real : imaginary, 1, 0}, 1, count, poles.moved[part % 2].data + first * m, m,
                    sum[part]);
        for (int64_t k = 0; k < m; ++k) {
            sum[0][k] -= sum[3][k];
            sum[1][k] += sum[2][k];
        }
        for (int part = 0; part < 2; ++part) combine({sum[part], 1, 0}, 1, m, poles.motion.data, m, moved[part]);
        for (int64_t k = 0; k < m; ++k) {
            const double by = w == 0 ? poles.omega_rad_s[k] : 1.0;
            work.weight[w * columns + k] = {moved[0][k] * by, moved[1][k] * by};
        }
    }
}

// Set what the body transmits to each audible partner: to more than 0.3 of its own sound in some mode, of those within
// 60 dB of its loudest, both without gains; or to a sensor that reads modes itself.
void set_transmissions(int64_t b, const ContactState& state, PoleWork& work) {
    end_transmissions(b, state.bank);
    const CoupledBody& body = work.body;
    if (!body.touches) return;
    const Mobility& one = state.poles.mobility[b];
    const int64_t m = one.modes, sets = state.bank.observed.shape[0], columns = state.bank.body[b].columns;
    std::vector<double>& least = work.separation;  // done with
    least.resize(m);
    double loudest = 0;
    work.step.resize(m);
    std::copy_n(&state.poles.weight[one.weight_at], m, work.step.data());
    for (const Turn& turn : work.turn) {
        Complex &first = work.step[turn.mode], &second = work.step[turn.mode + 1];
        const Complex x = first, y = second;
        first = {x.re * turn.by[0][0] + y.re * turn.by[1][0], x.im * turn.by[0][0] + y.im * turn.by[1][0]};
        second = {x.re * turn.by[0][1] + y.re * turn.by[1][1], x.im * turn.by[0][1] + y.im * turn.by[1][1]};
    }
    for (int64_t k = 0; k < m; ++k) least[k] = size_of(work.step[k]) / one.gain, loudest = std::max(loudest, least[k]);
    for (int64_t k = 0; k < m; ++k) least[k] = std::max(LEAST_TRANSMITTED * least[k], FAINTEST * loudest);
    for (size_t i = 0; i < body.partners.size(); ++i) {
        const int64_t to = body.partners[i];
        if (!state.poles.mobility[to].modes) continue;
        weigh_partner(i, columns, sets, state, work);
        quarter_turn(work.step, m, work.weight.data());
        const double gain = state.poles.mobility[to].gain;
        bool heard = false;
        for (int64_t k = 0; k < m; ++k) heard = heard || size_of(work.weight[k]) / gain > least[k];
        for (size_t k = columns; k < work.weight.size(); ++k) heard = heard || size_of(work.weight[k]) > 0;
        if (heard && !begin_transmission(b, to, {work.weight.data(), {sets, columns}}, state.bank)) return;
    }
}

}  // namespace

Complex limit_pole(Complex s, Complex free) {
    const bool finite = std::isfinite(s.re) && std::isfinite(s.im);
    if (finite && s.im <= FASTEST_TURN && s.im > SLOWEST_TURN && -s.re <= s.im) return {std::min(s.re, 0.0), s.im};
    return {std::min(free.re, -STOPPED_TURN), std::min(free.im, FASTEST_TURN)};
}

bool couple_body(int64_t b, Array<const double, 2> quaternion, const ContactState& state, PoleWork& work) {
    CoupledBody& body = work.body;
    const PoleTables& poles = state.poles;
    const int64_t m = poles.mobility[b].modes, touches = list_touches(b, state, work);
    body.touches = 0;
    if (!touches) return true;
    work.lam.clear(), work.decay.clear(), work.other_lam.clear(), work.other_decay.clear(), body.partner_mode.clear();
    add_motions(poles.mobility[b], poles, work.lam, work.decay);
    int64_t partner_modes = 0;
    std::vector<int64_t>& column = work.direction;  // where each partner's begin; at first
    column.clear();
    for (const int64_t partner : body.partners) {
        column.push_back(static_cast<int64_t>(work.other_lam.size()));
        body.partner_mode.push_back(partner_modes);
        partner_modes += poles.mobility[partner].modes;
        add_motions(poles.mobility[partner], poles, work.other_lam, work.other_decay);
    }
    for (int64_t& begin : work.begin) begin = column[begin];
    const int64_t own = m + RIGID, other = static_cast<int64_t>(work.other_lam.size()), rows = 3 * touches;
    work.own.assign(rows * own, 0.0), work.other.assign(rows * other, 0.0);
    body.spring.resize(rows), body.load_n.resize(touches);
    fill_touches(b, {work.places.data(), {static_cast<int64_t>(work.places.size())}},
                 {work.begin.data(), {static_cast<int64_t>(work.begin.size())}}, state.table, state.pairs, quaternion,
                 poles.sides,
                 {{work.own.data(), {rows, own}},
                  {work.other.data(), {rows, other}},
                  {body.spring.data(), {rows}},
                  {body.load_n.data(), {touches}}});
    const int64_t r = keep_springs(own, other, work);
    if (r == 0) return true;
    body.touches = touches;
    work.nothing.assign(r, 0.0);
    fit_poles(m, r, touches, poles.mobility[b].pairs, partner_modes, work);
    const CoupledSystem system{
        {work.own.data(), {r, own}},        {work.other.data(), {r, other}}, {body.spring.data(), {r}},
        {work.lam.data(), {own}},           {work.decay.data(), {own}},      {work.other_lam.data(), {other}},
        {work.other_decay.data(), {other}}, {work.nothing.data(), {r}},      {work.nothing.data(), {r}}};
    return couple_modes(system, {work.direction.data(), {r}}, pairs_of(b, poles), turns_of(b, state.table), body.poles,
                        body.force_n_s, work.coupling);
}

bool update_poles(int64_t b, Array<const double, 2> quaternion, double sr, const ContactState& state, PoleWork& work) {
    if (!couple_body(b, quaternion, state, work)) return false;
    const bool free = work.body.touches == 0;
    if (free) work.turn.clear();
    turn_modes(b, {work.turn.data(), {static_cast<int64_t>(work.turn.size())}}, free,
               {state.table, state.bank, state.scratch, state.pairs}, work.turns);
    set_body_poles(b, sr, state, work);
    set_transmissions(b, state, work);
    return true;
}

}  // namespace engine
