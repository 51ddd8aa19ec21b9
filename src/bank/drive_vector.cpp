#include "../vector8.hpp"
#include "drive.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

static_assert(LANES == VECTOR_LANES && SAMPLE_NUMBERS == 4 * LANES);

constexpr double FLUSH_SQUARED = FLUSH * FLUSH;
constexpr int64_t PAIR_NUMBERS = DRIVEN_ROOM * SAMPLE_NUMBERS;  // of the impulse, 16 lanes

struct Complex8 {
    Double8 re, im;
};

VECTOR_INLINE Complex8 operator*(const Complex8& a, const Complex8& b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

VECTOR_INLINE Double8 flushed(const Double8& value) {
    return where_at_least(value * value, spread(FLUSH_SQUARED), value);
}

VECTOR_INLINE double flushed(double value) {
    return value * value >= FLUSH_SQUARED ? value : 0.0;
}

void part_force(const double* force_n, const double* progress, double period_s, int64_t n, double* early,
                double* late) {
    const Double8 period = spread(period_s), one = spread(1.0);
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

constexpr int64_t SAMPLES_AT_ONCE = PARTS == 1 ? 8 : 2;  // so many sums fit the registers
static_assert(SAMPLES_AT_ONCE <= DRIVEN_ROOM - DRIVEN);

void project_forces(double* impulse, const ForceGains& gains, const BodyForces& forces, int64_t at,
                    const double* quadrature, int64_t lanes, int64_t count) {
    for (int64_t p = 0; p < lanes; p += LANE_PAIR) {
        const Double8 d_by_w[2] = {load(quadrature + p), load(quadrature + p + LANES)};
        double* out = impulse + p / LANE_PAIR * PAIR_NUMBERS;
        for (int64_t k = 0; k < count; k += SAMPLES_AT_ONCE) {
            Double8 sum[SAMPLES_AT_ONCE][2];
            for (int64_t i = 0; i < SAMPLES_AT_ONCE; ++i) sum[i][0] = sum[i][1] = spread(0.0);
            for (int64_t f = forces.first; f < forces.stop; ++f) {
                const int64_t which = forces.side[f];
                const double* gain0 = gains.gain0 + which * gains.columns + gains.column + p;
                const double* gain1 = gains.gain1 + which * gains.columns + gains.column + p;
                const double* early = forces.signal + (which >> 1) * 2 * forces.stride + at + k;
                const double* late = early + forces.stride;
                for (int h = 0; h < 2; ++h) {
                    const Double8 g0 = load(gain0 + h * LANES), g1 = load(gain1 + h * LANES);
                    for (int64_t i = 0; i < SAMPLES_AT_ONCE; ++i)
                        sum[i][h] = (sum[i][h] + spread(early[i]) * g0) + spread(late[i]) * g1;
                }
            }
            for (int64_t i = 0; i < SAMPLES_AT_ONCE; ++i)
                for (int h = 0; h < 2; ++h) {
                    store(out + (k + i) * SAMPLE_NUMBERS + h * LANES, sum[i][h]);
                    store(out + (k + i) * SAMPLE_NUMBERS + (2 + h) * LANES, sum[i][h] * d_by_w[h]);
                }
        }
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
            for (int h = 0; h < 2; ++h) sum[h].re = sum[h].im = spread(0.0);
            for (int64_t i = 0; i < plan.nodes; ++i, ++due)
                for (int h = 0; h < 2; ++h) {
                    sum[h] = sum[h] * d[h];
                    sum[h].re = sum[h].re + spread(*due);
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

VECTOR_INLINE void run_lanes(const DrivenModes& modes, const double* impulse, int64_t p, int64_t count, double* partial,
                             bool keep) {
    const int64_t re = modes.start + p, im = re + modes.modes;
    const double* weight = modes.weight + p;
    Complex8 f[2], pole[2], w[2];
    for (int h = 0; h < 2; ++h) {
        f[h] = {load(modes.state + re + h * LANES), load(modes.state + im + h * LANES)};
        pole[h] = {load(modes.pole + re + h * LANES), load(modes.pole + im + h * LANES)};
        w[h] = {load(weight + h * LANES), load(weight + modes.modes + h * LANES)};
    }
    for (int64_t k = 0; k < count; ++k) {
        Double8 sum = load(partial + k * LANES);
        for (int h = 0; h < 2; ++h) {
            Complex8 next = f[h] * pole[h];
            if (impulse) {
                next.re = next.re + load(impulse + k * SAMPLE_NUMBERS + h * LANES);
                next.im = next.im + load(impulse + k * SAMPLE_NUMBERS + (2 + h) * LANES);
            }
            sum = (sum + next.re * w[h].re) - next.im * w[h].im;
            f[h] = next;
        }
        store(partial + k * LANES, sum);
    }
    if (keep)
        for (int h = 0; h < 2; ++h) {
            store(modes.state + re + h * LANES, f[h].re);
            store(modes.state + im + h * LANES, f[h].im);
        }
}

void run(const DrivenModes& modes, const double* impulse, int64_t count, double* partial, bool keep) {
    if (impulse)
        for (int64_t p = 0; p < modes.count; p += LANE_PAIR)
            run_lanes(modes, impulse + p / LANE_PAIR * PAIR_NUMBERS, p, count, partial, keep);
    else
        for (int64_t p = 0; p < modes.count; p += LANE_PAIR) run_lanes(modes, nullptr, p, count, partial, keep);
}

void sum_forces(double* axis_impulse, const BodyForces& forces, const double* direction0, const double* direction1,
                int64_t count) {
    for (int64_t k = 0; k < count; k += LANES) {
        Double8 sum[3] = {spread(0.0), spread(0.0), spread(0.0)};
        for (int64_t f = forces.first; f < forces.stop; ++f) {
            const int64_t drive = forces.side[f] >> 1;
            const double* early = forces.signal + drive * 2 * forces.stride + k;
            const double sign = forces.side[f] & 1 ? -1.0 : 1.0;
            const Double8 a0 = load(early), a1 = load(early + forces.stride);
            for (int axis = 0; axis < 3; ++axis)
                sum[axis] = (sum[axis] + a0 * spread(sign * direction0[3 * drive + axis])) +
                            a1 * spread(sign * direction1[3 * drive + axis]);
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
    const Double8 scaled = spread(time * (1.0 / (1 << SQUARED)));
    const Complex8 z{s.re * scaled, s.im * scaled};
    const Double8 last = spread(TAYLOR.of[DEGREE]);
    Complex8 sum{last * z.re + spread(TAYLOR.of[DEGREE - 1]), last * z.im};
    for (int k = DEGREE - 2; k >= 0; --k) {
        sum = sum * z;
        sum.re = sum.re + spread(TAYLOR.of[k]);
    }
    for (int i = 0; i < SQUARED; ++i) sum = sum * sum;
    return sum;
}

void phasors(double* rows, int64_t width, const double* law, int64_t modes, int64_t lanes, const double* gain,
             double fraction, const double (&times)[4]) {
    for (int64_t k = 0; k < lanes; k += LANES) {
        const Complex8 s{load(law + k), load(law + modes + k)};
        const Double8 quadrature = load(law + 2 * modes + k), g = flushed(load(gain + k) * spread(fraction));
        for (int i = 0; i < 4; ++i) {
            Complex8 power = exponential(s, times[i]);
            if (i == 0) power = Complex8{g, g * quadrature} * power;
            store(rows + 2 * i * width + k, power.re);
            store(rows + (2 * i + 1) * width + k, power.im);
        }
    }
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Drive, drive) = {VECTOR_LEVEL::part_force, VECTOR_LEVEL::copy_flushed, VECTOR_LEVEL::project_forces,
                              VECTOR_LEVEL::clear,      VECTOR_LEVEL::strike_lanes, VECTOR_LEVEL::run,
                              VECTOR_LEVEL::sum_forces, VECTOR_LEVEL::across,       VECTOR_LEVEL::phasors};

}  // namespace engine
