#include "ringing.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

namespace {

constexpr double SMALL_GROWTH = 1e-4;  // below it a growth changes a level by less, and its integral is that without

struct Level {
    double of_first;  // a/a₀
    double area_s;    // ∫ (a/a₀)² dt
};

// The level of a mode of decay d and growth c since it began; fall = e^{−dt}.
Level level_at(double t_s, double fall, double d, double c, double power) {
    const double k = c / (1.0 + c);
    if (std::fabs(k) < SMALL_GROWTH) return {fall, d > 0 ? (1.0 - fall * fall) / (2.0 * d) : t_s};
    if (power == 2.0) {
        const double rest = 1.0 + c - c * fall * fall;
        return {fall / std::sqrt(rest), log(rest) / (2.0 * d * c)};
    }
    const double u = 1.0 / fall;
    const double area = log(u * (1.0 - k) / (u - k)) / (k * k) - 1.0 / (k * (u - k)) + 1.0 / (k * (1.0 - k));
    return {1.0 / ((1.0 + c) * u - c), area / (d * ((1.0 + c) * (1.0 + c)))};
}

}  // namespace

void add_linear_modes(Array<const Complex, 1> log_pole, Array<const Complex, 1> amplitude,
                      Array<const int64_t, 1> length, double start, Doubles sound) {
    const int64_t first = static_cast<int64_t>(std::ceil(start));
    for (int64_t k = 0; k < log_pole.size(); ++k) {
        const Complex s = log_pole[k], a = amplitude[k], pole = cexp(s);
        const int64_t last = std::min(sound.size(), first + length[k]);
        for (int64_t block = first; block < last; block += EXACT_EVERY) {
            const double since = static_cast<double>(block) - start;
            const Complex e = cexp({s.re * since, s.im * since});
            Complex z = {a.re * e.re - a.im * e.im, a.re * e.im + a.im * e.re};
            const int64_t stop = std::min(block + EXACT_EVERY, last);
            for (int64_t n = block; n < stop; ++n) {
                sound[n] += z.re;
                z = {z.re * pole.re - z.im * pole.im, z.re * pole.im + z.im * pole.re};
            }
        }
    }
}

void add_level_modes(const LevelModes& modes, Array<const int64_t, 1> length, double start, double sample_rate_hz,
                     Doubles sound) {
    const int64_t first = static_cast<int64_t>(std::ceil(start));
    for (int64_t k = 0; k < modes.omega_rad_s.size(); ++k) {
        const int64_t last = std::min(sound.size(), first + length[k]);
        const double c = modes.damping_growth[k], d = modes.decay_per_s[k], omega = modes.omega_rad_s[k];
        const Complex a = modes.amplitude[k];
        const double size = std::sqrt(a.re * a.re + a.im * a.im), angle = atan2(a.im, a.re);
        const double step = exp(-d / sample_rate_hz);
        for (int64_t block = first; block < last; block += EXACT_EVERY) {
            double fall = exp(-d * (static_cast<double>(block) - start) / sample_rate_hz);
            const int64_t stop = std::min(block + EXACT_EVERY, last);
            for (int64_t n = block; n < stop; ++n) {
                const double t_s = (static_cast<double>(n) - start) / sample_rate_hz;
                const Level level = level_at(t_s, fall, d, c, modes.power);
                sound[n] += size * level.of_first * cos(angle + omega * (t_s + modes.bend[k] * level.area_s));
                fall *= step;
            }
        }
    }
}

}  // namespace engine
