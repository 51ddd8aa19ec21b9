#include "motion_poles.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "motion_poles_vector.hpp"

namespace engine {

namespace {

struct Number {  // complex
    double re, im;
};

Number operator+(Number a, Number b) {
    return {a.re + b.re, a.im + b.im};
}
Number operator-(Number a, Number b) {
    return {a.re - b.re, a.im - b.im};
}
Number operator*(Number a, Number b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
Number operator*(double a, Number b) {
    return {a * b.re, a * b.im};
}

// a/b by Smith's method [1962, Comm. ACM 5, 435]: no square that could overflow.
Number operator/(Number a, Number b) {
    if (std::fabs(b.re) >= std::fabs(b.im)) {
        const double ratio = b.im / b.re, below = b.re + b.im * ratio;
        return {(a.re + a.im * ratio) / below, (a.im - a.re * ratio) / below};
    }
    const double ratio = b.re / b.im, below = b.re * ratio + b.im;
    return {(a.re * ratio + a.im) / below, (a.im * ratio - a.re) / below};
}

double size_of(Number z) {
    return std::sqrt(z.re * z.re + z.im * z.im);
}

Number root_of(Number z) {  // the one with a real part not below 0
    const double size = size_of(z);
    if (size == 0) return {0, z.im};
    const double root = std::sqrt((std::fabs(z.re) + size) * 0.5);
    if (z.re >= 0) return {root, z.im / (2 * root)};
    return {std::fabs(z.im) / (2 * root), std::copysign(root, z.im)};
}

// Whether a partner's motion is a rigid one that a spring moves.
bool is_light(const CoupledSystem& system, int64_t p) {
    if (system.other_lam[p] != 0) return false;
    for (int64_t c = 0; c < system.spring.size(); ++c)
        if (system.other(c, p) != 0) return true;
    return false;
}

// Turn the pairs of modes to their motions: rows of vector, columns of both; fill turn (p,).
//
// Of each pair the turn is the orthogonal matrix nearest to its part of the two motions [Schönemann 1966], columns in
// the order, and with the sign, in which they resemble those before.
void turn_pairs(const Motions& motions, Array<Turn, 1> turn) {
    const Array<double, 2>&vector = motions.vector, &both = motions.both;
    const Integers& chosen = motions.chosen;
    int64_t earlier = 0;
    for (int64_t pair = 0; pair < motions.pairs.size(); ++pair) {
        const int64_t i = motions.pairs[pair];
        const double a = vector(i, chosen[i]), b = vector(i, chosen[i + 1]);
        const double c = vector(i + 1, chosen[i]), d = vector(i + 1, chosen[i + 1]);
        const double sign = a * d - b * c >= 0.0 ? 1.0 : -1.0;
        double x = a + sign * d, y = b - sign * c;
        const double length = std::sqrt(x * x + y * y);
        x = length > 0 ? x / length : 1.0, y = length > 0 ? y / length : 0.0;
        const double made[2][2] = {{x, y}, {-sign * y, sign * x}};
        double old[2][2] = {{1, 0}, {0, 1}}, along[2][2];
        while (earlier < motions.before.size() && motions.before[earlier].mode < i) ++earlier;
        if (earlier < motions.before.size() && motions.before[earlier].mode == i)
            std::copy_n(&motions.before[earlier].by[0][0], 4, &old[0][0]);
        for (int row = 0; row < 2; ++row)
            for (int column = 0; column < 2; ++column)
                along[row][column] = old[0][row] * made[0][column] + old[1][row] * made[1][column];
        int first = 0, second = 1;
        if (std::fabs(along[0][1]) + std::fabs(along[1][0]) > std::fabs(along[0][0]) + std::fabs(along[1][1])) {
            std::swap(first, second);
            std::swap(chosen[i], chosen[i + 1]);
        }
        const double one = along[0][first] < 0 ? -1.0 : 1.0, other = along[1][second] < 0 ? -1.0 : 1.0;
        const double p = made[0][first] * one, q = made[0][second] * other;
        const double r = made[1][first] * one, s = made[1][second] * other;
        turn[pair] = {i, {{p, q}, {r, s}}};
        for (int64_t n = 0; n < vector.shape[1]; ++n) {
            const double u = vector(i, n), v = vector(i + 1, n);
            vector(i, n) = p * u + r * v, vector(i + 1, n) = q * u + s * v;
        }
        for (int64_t n = 0; n < both.shape[0]; ++n) {
            const double u = both(n, i), v = both(n, i + 1);
            both(n, i) = p * u + r * v, both(n, i + 1) = q * u + s * v;
        }
    }
}

// Compute the forces (r, n) at the springs of all motions.
void press_springs(const CoupledSystem& system, const Motions& motions, MotionWork& x) {
    const int64_t n = motions.value.size(), r = system.spring.size();
    for (int64_t c = 0; c < r; ++c)
        for (int64_t i = 0; i < n; ++i) x.pressed[c * n + i] = motions.both(c, i) * system.spring[c].real();
    motion_loops().combine({x.pressed.data(), 1, n}, r, n, motions.vector.data, n, x.every.data());
}

// Which elements of a row or column of a matrix are not 0: the first, and the one after the last.
struct Extent {
    int64_t first, stop;
};

// Of ``count`` numbers ``stride`` apart.
Extent extent_of(const double* values, int64_t stride, int64_t count) {
    Extent found{0, count};
    while (found.stop > 0 && values[(found.stop - 1) * stride] == 0) --found.stop;
    while (found.first < found.stop && values[found.first * stride] == 0) ++found.first;
    return found;
}

// The places of a partner's mode in the scratch.
PartnerResponse response_of(MotionWork& x, int64_t mode) {
    const int64_t apart = x.partner_modes * x.motions;
    double* u = x.moved.data() + mode * x.motions;
    return {u, u + apart, u + 2 * apart, u + 3 * apart};
}

// Write the partners' motion to gives, and add its square to slope. A spring moves the modes of one partner alone.
void move_partners(const CoupledSystem& system, MotionWork& x) {
    const int64_t r = x.springs, m = x.motions;
    const int64_t columns = system.other_lam.size();
    int64_t mode = 0;
    for (int64_t p = 0; p < columns; ++p) {
        if (system.other_lam[p] <= 0) continue;
        const auto [first, stop] = extent_of(system.other.data + p, columns, r);
        motion_loops().combine({system.other.data + first * columns + p, columns, 0}, 1, stop - first,
                               x.force.data() + first * m, m, x.row.data());
        motion_loops().respond(system.other_lam[p], 2.0 * system.other_decay[p], x.row.data(), x.rate.data(),
                               x.square.data(), m, response_of(x, mode++), x.slope.data(), x.slope.data() + m);
    }
    for (int64_t c = 0; c < r; ++c) {
        mode = 0;
        for (int64_t p = 0; p < columns; ++p)
            if (system.other_lam[p] > 0) x.row[mode++] = system.other(c, p);
        const auto [first, stop] = extent_of(x.row.data(), 1, mode);
        const PartnerResponse moved = response_of(x, first);
        motion_loops().combine({x.row.data() + first, 1, 0}, 1, stop - first, moved.u, m, x.gives.data() + c * m);
        motion_loops().combine({x.row.data() + first, 1, 0}, 1, stop - first, moved.v, m, x.gives.data() + (r + c) * m);
    }
}

// Add what lies under the springs, and their loss, to gives, which holds the partners' modes; and Fᵀg of both.
void yield_springs(const CoupledSystem& system, MotionWork& x) {
    const int64_t r = x.springs, m = x.motions;
    for (int64_t c = 0; c < r; ++c) {
        const Number spring{system.spring[c].real(), system.spring[c].imag()};
        Number loss = Number{1, 0} / spring;
        loss.re -= 1.0 / spring.re;
        double *first = x.gives.data() + c * m, *second = x.gives.data() + (r + c) * m;
        for (int64_t k = 0; k < m; ++k) {
            const double w = x.rate[k], f = x.force[c * m + k];
            const double below = system.plate[c] + system.half_space[c] * x.square[k];
            if (w > 0)
                second[k] -= below / w * f;
            else
                first[k] += below * f;
            x.contact[k] += f * f * loss.re, x.contact[m + k] += f * f * loss.im;
            x.partner[k] += f * first[k], x.partner[m + k] += f * second[k];
            first[k] += loss.re * f;
            second[k] += loss.im * f;
        }
    }
}

// Compute gᵀRg of the forces F (r, n) of all motions and the compliant motion g of the chosen ones.
//
// Two motions of nearly one frequency would each need the other's: their mutual term is bounded by their product.
void hold_against(const CoupledSystem& system, const Motions& motions, MotionWork& x) {
    const int64_t r = x.springs, m = x.motions, n = motions.value.size();
    constexpr int64_t at_once = MotionWork::PRODUCTS;
    double *real = x.products.data(), *imaginary = real + at_once * m;
    for (int64_t i = 0; i < n; i += at_once) {
        const int64_t many = std::min(at_once, n - i);
        motion_loops().combine({x.every.data() + i, n, 1}, many, r, x.gives.data(), m, real);
        motion_loops().combine({x.every.data() + i, n, 1}, many, r, x.gives.data() + r * m, m, imaginary);
        for (int64_t j = 0; j < many; ++j)
            motion_loops().hold(motions.value[i + j], x.free.data(), real + j * m, imaginary + j * m, m, x.held.data(),
                                x.held.data() + m);
    }
    for (int64_t c = 0; c < r; ++c)
        motion_loops().add_square(system.spring[c].real(), x.gives.data() + c * m, x.gives.data() + (r + c) * m, m,
                                  x.held.data(), x.held.data() + m);
}

// Split a decay into shares (3,): the body's own, the contacts', the partners', each with a power not below 0.
void split_decay(double own, double contact, double partner, double size, double decay, double* shares) {
    shares[0] = std::max(own, 0.0), shares[1] = std::max(-contact * size, 0.0);
    shares[2] = std::max(-partner * size, 0.0);
    const double whole = std::max(shares[0] + shares[1] + shares[2], 1e-300);
    for (int i = 0; i < 3; ++i) shares[i] *= decay / whole;
}

// Write the partners' velocities (P, m) per velocity of each motion; of one that is held, 0.
void share_motion(const MotionPoles& poles, MotionWork& x) {
    const int64_t m = x.motions;
    double* size = x.row.data();
    std::fill_n(size, m, 1.0);
    for (int64_t p = 0; p < x.partner_modes; ++p)
        motion_loops().share(poles.newton.data, x.part.data(), x.shift.data(), m, response_of(x, p), size);
    for (int64_t k = 0; k < m; ++k) size[k] = 1.0 / size[k];
    for (int64_t p = 0; p < x.partner_modes; ++p) {
        const PartnerResponse response = response_of(x, p);
        double *real = poles.moved[0][p].data, *imaginary = poles.moved[1][p].data;
        for (int64_t k = 0; k < m; ++k) real[k] = response.u[k] * size[k], imaginary[k] = response.v[k] * size[k];
    }
}

// Compute the pole of motion k from its square and what yields and holds; write its velocity at the springs.
void solve_motion(int64_t k, double highest_rad_s, const CoupledSystem& system, const MotionPoles& poles,
                  MotionWork& x) {
    const int64_t r = x.springs, m = x.motions;
    const double w = x.rate[k], damped = x.damped[k];
    const Number contact{x.contact[k], x.contact[m + k]}, partner{x.partner[k], x.partner[m + k]};
    const Number yielded = contact + partner, against{x.held[k], x.held[m + k]}, unit{1, 0};
    const bool yields = std::fabs(yielded.re) > 0 || std::fabs(yielded.im) > 0;
    const Number one = unit / (unit + against / (yields ? yielded : unit));
    const Number squared = one * one;
    const Number steep = Number{-squared.re, -squared.im} * Number{x.slope[k], x.slope[m + k]};
    Number off = one * yielded * (Number{2, 0} / (unit + root_of(unit - 4.0 * steep)));
    if (off.im > 0) off.im = 0;  // no mode gains
    const Number root = root_of({x.square[k] - off.re - damped * damped, -off.im});
    Number pole{-damped - root.im, root.re};
    bool& newton = poles.newton[k];
    newton = !(w > STIFFEST_RATIO * highest_rad_s || -pole.re > STOPPED_RATIO * size_of(pole) || !(pole.im > 0));
    if (!newton) {
        const double rate = std::sqrt(system.lam[k]);
        pole = {-rate * STOPPED_RATIO, rate * std::sqrt(1.0 - STOPPED_RATIO * STOPPED_RATIO)};
    }
    poles.omega_rad_s[k] = pole.im, poles.decay_per_s[k] = std::max(-pole.re, 0.0);
    const Number along = w > 0 ? one / Number{0, w} : one, turned = off * one;
    for (int64_t c = 0; c < r; ++c) {
        poles.force(0, c, k) = newton ? x.force[c * m + k] * along.re : 0.0;
        poles.force(1, c, k) = newton ? x.force[c * m + k] * along.im : 0.0;
    }
    x.part[k] = one.re, x.part[m + k] = one.im, x.shift[k] = turned.re, x.shift[m + k] = turned.im;
    const double size = (one.re * one.re + one.im * one.im) / std::max(2.0 * w, 1e-300);
    split_decay(damped, contact.im, partner.im, size, poles.decay_per_s[k], poles.shares[k].data);
}

}  // namespace

int64_t count_motions(const CoupledSystem& system) {
    int64_t count = system.own.shape[1];
    for (int64_t p = 0; p < system.other_lam.size(); ++p) count += is_light(system, p);
    return count;
}

int64_t count_partner_modes(const CoupledSystem& system) {
    return std::count_if(system.other_lam.data, system.other_lam.data + system.other_lam.size(),
                         [](double lam) { return lam > 0; });
}

void couple_springs(const CoupledSystem& system, Array<double, 2> both, Array<double, 2> stiffness, Doubles factor) {
    const int64_t r = system.spring.size(), own = system.own.shape[1], n = both.shape[1];
    for (int64_t c = 0; c < r; ++c) std::copy_n(system.own[c].data, own, both[c].data);
    int64_t at = own;
    for (int64_t p = 0; p < system.other_lam.size(); ++p) {
        if (!is_light(system, p)) continue;
        for (int64_t c = 0; c < r; ++c) both(c, at) = -system.other(c, p);
        ++at;
    }
    for (int64_t c = 0; c < r; ++c)
        for (int64_t i = 0; i < n; ++i) factor[c * n + i] = system.spring[c].real() * both(c, i);
    motion_loops().combine({factor.data, n, 1}, n, r, both.data, n, stiffness.data);
    for (int64_t i = 0; i < own; ++i) stiffness(i, i) += system.lam[i];
}

void choose_motions(Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen, Doubles part) {
    const int64_t n = vector.shape[1], m = chosen.size();
    int64_t paired = 0;
    std::fill_n(chosen.data, m, -1);
    for (int64_t i = 0; i < m;) {
        const int64_t many = paired < pairs.size() && pairs[paired] == i ? 2 : 1;
        paired += many - 1;
        for (int64_t k = 0; k < n; ++k) {
            part[k] = vector(i, k) * vector(i, k);
            if (many == 2) part[k] += vector(i + 1, k) * vector(i + 1, k);
        }
        for (int64_t j = 0; j < many; ++j) {
            const int64_t best = std::max_element(part.data, part.data + n) - part.data;
            if (std::find(chosen.data, chosen.data + i, best) != chosen.data + i) {
                chosen[0] = -1;
                return;
            }
            chosen[i + j] = best, part[best] = -1.0;
        }
        i += many;
    }
}

void MotionWork::fit(int64_t r, int64_t m, int64_t n, int64_t modes) {
    springs = r, motions = m, partner_modes = modes;
    every.resize(r * n), pressed.resize(r * n), products.resize(2 * PRODUCTS * m), force.resize(r * m),
        gives.resize(2 * r * m), moved.resize(4 * modes * m);
    for (std::vector<double>* values : {&free, &square, &rate}) values->resize(m);
    for (std::vector<double>* values : {&part, &shift}) values->resize(2 * m);
    damped.assign(m, 0.0);
    for (std::vector<double>* sums : {&slope, &contact, &partner, &held}) sums->assign(2 * m, 0.0);
    row.resize(std::max({m, n, modes}));
}

void solve_motions(const CoupledSystem& system, const Motions& motions, const MotionPoles& poles, MotionWork& x) {
    const int64_t r = system.spring.size(), m = motions.chosen.size(), n = motions.value.size();
    x.fit(r, m, n, count_partner_modes(system));
    turn_pairs(motions, poles.turn);
    press_springs(system, motions, x);
    double highest = 0;
    for (int64_t k = 0; k < m; ++k) {
        const int64_t motion = motions.chosen[k];
        highest = std::max(highest, system.lam[k]);
        double* along = poles.motion[k].data;
        for (int64_t i = 0; i < m; ++i) {
            const double of = motions.vector(i, motion);
            along[i] = of;
            x.damped[k] += of * of * system.decay[i];
        }
        x.free[k] = motions.value[motion];
        x.square[k] = std::max(x.free[k], 0.0);
        x.rate[k] = std::sqrt(x.square[k]);
        for (int64_t c = 0; c < r; ++c) x.force[c * m + k] = x.every[c * n + motion];
    }
    highest = std::sqrt(highest);
    move_partners(system, x);
    yield_springs(system, x);
    hold_against(system, motions, x);
    for (int64_t k = 0; k < m; ++k) solve_motion(k, highest, system, poles, x);
    share_motion(poles, x);
}

}  // namespace engine
