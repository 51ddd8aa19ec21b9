#include "../vector8.hpp"
#include "drive.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

static_assert(SAMPLE_NUMBERS == 4 * LANES);

constexpr int64_t PAIR_NUMBERS = DRIVEN * SAMPLE_NUMBERS;  // of the impulse, 16 lanes
constexpr int64_t PAIR_PUSHES = DRIVEN * LANE_PAIR;        // and of the forces

void part_force(const double* force_n, const double* progress, double period_s, int64_t n, double* early,
                double* late) {
    const Double8 period = broadcast(period_s), one = broadcast(1.0);
    int64_t k = 0;
    for (; k + LANES <= n; k += LANES) {
        const Double8 impulse = flushed(load(force_n + k) * period), x = load(progress + k);
        store(early + k, impulse * (one - x));
        store(late + k, impulse * x);
    }
    for (; k < n; ++k) {
        const double impulse = flushed(force_n[k] * period_s);
        early[k] = impulse * (1.0 - progress[k]);
        late[k] = impulse * progress[k];
    }
}

void copy_flushed(const double* values, int64_t n, double* out) {
    int64_t k = 0;
    for (; k + LANES <= n; k += LANES) store(out + k, flushed(load(values + k)));
    for (; k < n; ++k) out[k] = flushed(values[k]);
}

// Set or add one force on 16 lanes.
VECTOR_INLINE void project_one(double* push, const double* gain0, const double* gain1, const double* early,
                               const double* late, int64_t count, bool adds) {
    const Double8 g0[2] = {load(gain0), load(gain0 + LANES)}, g1[2] = {load(gain1), load(gain1 + LANES)};
    for (int64_t k = 0; k < count; ++k) {
        const Double8 a0 = broadcast(early[k]), a1 = broadcast(late[k]);
        for (int h = 0; h < 2; ++h) {
            double* out = push + k * LANE_PAIR + h * LANES;
            store(out, (adds ? load(out) + a0 * g0[h] : a0 * g0[h]) + a1 * g1[h]);
        }
    }
}

void project_forces(double* push, const ForceGains& gains, const BodyForces& forces, int64_t at, int64_t lanes,
                    int64_t count) {
    for (int64_t p = 0; p < lanes; p += LANE_PAIR, push += PAIR_PUSHES)
        for (int64_t f = forces.first; f < forces.stop; ++f) {
            const int64_t which = forces.side[f], place = which * gains.columns + gains.column + p;
            const double* early = forces.signal + (which >> 1) * 2 * forces.stride + at;
            const double *gain0 = gains.gain0 + place, *gain1 = gains.gain1 + place;
            if (f == forces.first)
                project_one(push, gain0, gain1, early, early + forces.stride, count, false);
            else
                project_one(push, gain0, gain1, early, early + forces.stride, count, true);
        }
}

void clear(double* impulse, int64_t lanes, int64_t count) {
    for (int64_t p = 0; p < lanes; p += LANE_PAIR)
        std::memset(impulse + p / LANE_PAIR * PAIR_NUMBERS, 0, sizeof(double) * count * SAMPLE_NUMBERS);
}

VECTOR_INLINE Complex8 load_row(const StrikePhasors& strike, int row, int64_t place) {
    return {load(strike.rows + 2 * row * strike.width + place),
            load(strike.rows + (2 * row + 1) * strike.width + place)};
}

void strike_lanes(double* impulse, const StrikePhasors& strike, int64_t lanes, bool keep) {
    for (int64_t p = 0; p < lanes; p += LANE_PAIR) {
        Complex8 r[2] = {load_row(strike, 0, p), load_row(strike, 0, p + LANES)};
        const Complex8 d[2] = {load_row(strike, 1, p), load_row(strike, 1, p + LANES)};
        const double* due = strike.due;
        for (int64_t k = strike.first; k < strike.stop; ++k) {
            const NodePlan& plan = strike.plan[k];
            if (plan.turn >= 0)
                for (int h = 0; h < 2; ++h)
                    r[h] = r[h] * load_row(strike, 2 + static_cast<int>(plan.turn), p + h * LANES);
            Complex8 sum[2];
            for (int h = 0; h < 2; ++h) sum[h].re = sum[h].im = broadcast(0.0);
            for (int64_t i = 0; i < plan.nodes; ++i, ++due)
                for (int h = 0; h < 2; ++h) {
                    sum[h] = sum[h] * d[h];
                    sum[h].re = sum[h].re + broadcast(*due);
                }
            for (int64_t i = 0; i < plan.empty; ++i)
                for (int h = 0; h < 2; ++h) sum[h] = sum[h] * d[h];
            double* out = impulse + p / LANE_PAIR * PAIR_NUMBERS + k * SAMPLE_NUMBERS;
            for (int h = 0; h < 2; ++h) {
                const Complex8 hit = sum[h] * r[h];
                store(out + h * LANES, load(out + h * LANES) + hit.re);
                store(out + (2 + h) * LANES, load(out + (2 + h) * LANES) + hit.im);
            }
        }
        if (keep)
            for (int h = 0; h < 2; ++h) {
                store(strike.rows + p + h * LANES, r[h].re);
                store(strike.rows + strike.width + p + h * LANES, r[h].im);
            }
    }
}

// What multiplies and drives eight modes; null where nothing does.
struct EightModes {
    const double *pole_re, *pole_im, *weight_re, *weight_im, *quadrature, *impulse, *push;
};

VECTOR_INLINE EightModes eight_modes(const DrivenModes& modes, const double* impulse, const double* push, int64_t p) {
    const double *pole = modes.pole + modes.start + p, *weight = modes.weight + p;
    return {pole, pole + modes.modes, weight, weight + modes.modes, modes.quadrature + p, impulse, push};
}

// Advance eight modes by sample k and add what they sound to sum. What multiplies the state is read each time: the
// registers are the state's.
VECTOR_INLINE Complex8 advance_eight(const Complex8& f, const EightModes& modes, int64_t k, Double8& sum) {
    Complex8 next = f * Complex8{load(modes.pole_re), load(modes.pole_im)};
    if (modes.push) {
        const Double8 force = load(modes.push + k * LANE_PAIR);
        next.re = next.re + force;
        next.im = next.im + force * load(modes.quadrature);
    }
    if (modes.impulse) {
        next.re = next.re + load(modes.impulse + k * SAMPLE_NUMBERS);
        next.im = next.im + load(modes.impulse + k * SAMPLE_NUMBERS + 2 * LANES);
    }
    sum = (sum + next.re * load(modes.weight_re)) - next.im * load(modes.weight_im);
    return next;
}

VECTOR_INLINE void run_lanes(const DrivenModes& modes, const double* impulse, const double* push, int64_t p,
                             int64_t count, double* partial, bool keep) {
    double *re = modes.state + modes.start + p, *im = re + modes.modes;
    const EightModes low = eight_modes(modes, impulse, push, p);
    const EightModes high =
        eight_modes(modes, impulse ? impulse + LANES : nullptr, push ? push + LANES : nullptr, p + LANES);
    Complex8 f{load(re), load(im)}, g{load(re + LANES), load(im + LANES)};
    for (int64_t k = 0; k < count; ++k) {
        Double8 sum = load(partial + k * LANES);
        f = advance_eight(f, low, k, sum);
        g = advance_eight(g, high, k, sum);
        store(partial + k * LANES, sum);
    }
    if (!keep) return;
    store(re, f.re), store(im, f.im);
    store(re + LANES, g.re), store(im + LANES, g.im);
}

void run(const DrivenModes& modes, const double* impulse, const double* push, int64_t count, double* partial,
         bool keep) {
    for (int64_t p = 0; p < modes.count; p += LANE_PAIR) {  // a loop of its own for each of what there is
        const double* strikes = impulse ? impulse + p / LANE_PAIR * PAIR_NUMBERS : nullptr;
        const double* forces = push ? push + p / LANE_PAIR * PAIR_PUSHES : nullptr;
        if (impulse && push)
            run_lanes(modes, strikes, forces, p, count, partial, keep);
        else if (impulse)
            run_lanes(modes, strikes, nullptr, p, count, partial, keep);
        else if (push)
            run_lanes(modes, nullptr, forces, p, count, partial, keep);
        else
            run_lanes(modes, nullptr, nullptr, p, count, partial, keep);
    }
}

void sum_forces(double* axis_impulse, const BodyForces& forces, const double* direction0, const double* direction1,
                int64_t count) {
    for (int64_t k = 0; k < count; k += LANES) {
        Double8 sum[3] = {broadcast(0.0), broadcast(0.0), broadcast(0.0)};
        for (int64_t f = forces.first; f < forces.stop; ++f) {
            const int64_t drive = forces.side[f] >> 1;
            const double* early = forces.signal + drive * 2 * forces.stride + k;
            const double sign = forces.side[f] & 1 ? -1.0 : 1.0;
            const Double8 a0 = load(early), a1 = load(early + forces.stride);
            for (int axis = 0; axis < 3; ++axis)
                sum[axis] = (sum[axis] + a0 * broadcast(sign * direction0[3 * drive + axis])) +
                            a1 * broadcast(sign * direction1[3 * drive + axis]);
        }
        for (int axis = 0; axis < 3; ++axis) store(axis_impulse + 2 * axis * forces.stride + k, sum[axis]);
    }
}

void across(const double* partial, int64_t count, double* out) {
    for (int64_t k = 0; k < count; ++k) out[k] = total(load(partial + k * LANES));
}

constexpr int DEGREE = 14;
constexpr int SQUARED = 3;

struct Coefficients {
    double of[DEGREE + 1];
};

constexpr Coefficients inverse_factorials() {
    Coefficients out{};
    double factorial = 1;
    for (int k = 0; k <= DEGREE; ++k) {
        if (k > 0) factorial *= k;
        out.of[k] = 1 / factorial;
    }
    return out;
}

constexpr Coefficients TAYLOR = inverse_factorials();

// e^{s·time}, |s·time| ≤ 3.73 (|Im s| < π, Re s > -2): (Σ_k (z/8)^k / k!)^8, k ≤ 14; the rest is below 1e-17.
VECTOR_INLINE Complex8 exponential(const Complex8& s, double time) {
    const Double8 scaled = broadcast(time * (1.0 / (1 << SQUARED)));
    const Complex8 z{s.re * scaled, s.im * scaled};
    const Double8 last = broadcast(TAYLOR.of[DEGREE]);
    Complex8 sum{last * z.re + broadcast(TAYLOR.of[DEGREE - 1]), last * z.im};
    for (int k = DEGREE - 2; k >= 0; --k) {
        sum = sum * z;
        sum.re = sum.re + broadcast(TAYLOR.of[k]);
    }
    for (int i = 0; i < SQUARED; ++i) sum = sum * sum;
    return sum;
}

void phasors(double* rows, int64_t width, const double* law, int64_t modes, int64_t lanes, const double* gain,
             double fraction, const double (&times)[4]) {
    for (int64_t k = 0; k < lanes; k += LANES) {
        const Complex8 s{load(law + k), load(law + modes + k)};
        const Double8 quadrature = load(law + 2 * modes + k), g = flushed(load(gain + k) * broadcast(fraction));
        for (int i = 0; i < 4; ++i) {
            Complex8 power = exponential(s, times[i]);
            if (i == 0) power = Complex8{g, g * quadrature} * power;
            store(rows + 2 * i * width + k, power.re);
            store(rows + (2 * i + 1) * width + k, power.im);
        }
    }
}

// a/(1 - b)
VECTOR_INLINE Complex8 over_rest(const Complex8& a, const Complex8& b) {
    const Double8 re = broadcast(1.0) - b.re, size = re * re + b.im * b.im;
    return {(a.re * re - a.im * b.im) / size, (a.im * re + a.re * b.im) / size};
}

void sum_strike(double* rows, int64_t width, const double* law, int64_t modes, int64_t lanes,
                const NodeGroup (&groups)[2]) {
    for (int64_t k = 0; k < lanes; k += LANES) {
        const Complex8 s{load(law + k), load(law + modes + k)};
        const Complex8 r{load(rows + k), load(rows + width + k)};
        const Complex8 d{load(rows + 2 * width + k), load(rows + 3 * width + k)};
        Complex8 all{broadcast(0.0), broadcast(0.0)};
        for (const NodeGroup& group : groups) {
            if (group.count == 0) continue;
            Complex8 sum{broadcast(0.0), broadcast(0.0)};
            for (int64_t i = 0; i < group.count; ++i) {
                sum = sum * d;
                sum.re = sum.re + broadcast(group.impulse[i]);
            }
            if (group.late != groups[0].late) sum = sum * exponential(s, group.late - groups[0].late);
            all.re = all.re + sum.re, all.im = all.im + sum.im;
        }
        const Complex8 whole = over_rest(all * r, exponential(s, 1.0));
        const Double8 least = broadcast(FLUSH);  // a spare lane has no turn
        store(rows + 8 * width + k, where_at_least(s.im, least, whole.re));
        store(rows + 9 * width + k, where_at_least(s.im, least, whole.im));
    }
}

double lasting_strike(const double* weight, int64_t modes, const double* re, const double* im, int64_t lanes) {
    Double8 sum = broadcast(0.0);
    for (int64_t k = 0; k < lanes; k += LANES)
        sum = (sum + load(weight + modes + k) * load(im + k)) - load(weight + k) * load(re + k);
    return total(sum);
}

void lasting_forces(const DrivenModes& modes, double* lasting) {
    const double* pole = modes.pole + modes.start;
    for (int64_t k = 0; k < modes.count; k += LANES) {
        const Double8 re = load(modes.weight + k), im = load(modes.weight + modes.modes + k);
        const Double8 q = load(modes.quadrature + k);
        const Complex8 onset{im * q - re, -(im + re * q)};  // -w (1 + i d/ω)
        store(lasting + k, over_rest(onset, {load(pole + k), load(pole + modes.modes + k)}).re);
    }
}

double dot(const double* a, const double* b, int64_t lanes) {
    Double8 sum = broadcast(0.0);
    for (int64_t k = 0; k < lanes; k += LANES) sum = sum + load(a + k) * load(b + k);
    return total(sum);
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Drive, drive) = {VECTOR_LEVEL::part_force, VECTOR_LEVEL::copy_flushed,   VECTOR_LEVEL::project_forces,
                              VECTOR_LEVEL::clear,      VECTOR_LEVEL::strike_lanes,   VECTOR_LEVEL::run,
                              VECTOR_LEVEL::sum_forces, VECTOR_LEVEL::across,         VECTOR_LEVEL::phasors,
                              VECTOR_LEVEL::sum_strike, VECTOR_LEVEL::lasting_strike, VECTOR_LEVEL::lasting_forces,
                              VECTOR_LEVEL::dot};

}  // namespace engine
