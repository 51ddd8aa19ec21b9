#include "spectrogram_maps.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

void add_damped_lines(Array<const Complex, 1> pole, Array<const Complex, 1> amplitude, Array<const int64_t, 1> length,
                      Doubles sound) {
    for (int64_t k = 0; k < pole.size(); ++k) {
        const Complex p = pole[k];
        Complex z = amplitude[k];
        if (z.re == 0 && z.im == 0) continue;
        for (int64_t n = 0; n < length[k]; ++n) {
            sound[n] += z.re;
            z = {z.re * p.re - z.im * p.im, z.re * p.im + z.im * p.re};
        }
    }
}

void renew_phases(Array<ComplexFloat, 2> spectrum, Array<ComplexFloat, 2> before, Array<const float, 2> magnitude,
                  float momentum) {
    constexpr float tiny = 1e-30f;
    const float more = 1.0f + momentum;
    for (int64_t m = 0; m < magnitude.size(); ++m) {
        for (int64_t k = 0; k < magnitude.shape[1]; ++k) {
            const ComplexFloat now = spectrum(m, k);
            const float re = more * now.re - momentum * before(m, k).re;
            const float im = more * now.im - momentum * before(m, k).im;
            before(m, k) = now;
            const float scale = magnitude(m, k) / std::sqrt(re * re + im * im + tiny);
            spectrum(m, k) = {re * scale, im * scale};
        }
    }
}

void power_ratios(Array<const double, 1> freq_hz, Array<const double, 1> centre_hz, Array<const double, 1> half_hz,
                  Array<const double, 1> source_power, Array<const double, 1> target_power, Doubles ratio) {
    for (int64_t k = 0; k < freq_hz.size(); ++k) {
        double up = 0, down = 0;
        for (int64_t p = 0; p < centre_hz.size(); ++p) {
            const double off = (freq_hz[k] - centre_hz[p]) / half_hz[p];
            const double skirt = 1.0 / (1.0 + off * off);
            up += target_power[p] * skirt;
            down += source_power[p] * skirt;
        }
        ratio[k] = up / down;
    }
}

void move_power(const PowerMap& power, Array<const double, 1> source_hz, Array<const double, 1> level,
                Array<const double, 1> rate, Array<const double, 1> time_s, Doubles row, Array<double, 2> moved) {
    const auto &freq = power.freq_hz, &time = power.time_s;
    const int64_t bands = freq.size(), times = time.size();
    for (int64_t k = 0; k < source_hz.size(); ++k) {
        const Doubles out = moved[k];
        for (int64_t n = 0; n < time_s.size(); ++n) out[n] = 0;
        const double f = source_hz[k];
        if (f > freq[bands - 1] || level[k] <= 0) continue;
        const int64_t above = std::lower_bound(freq.data, freq.data + bands, f) - freq.data;
        const int64_t i = std::min(std::max<int64_t>(above - 1, 0), bands - 2);
        const double part = std::min(std::max((f - freq[i]) / (freq[i + 1] - freq[i]), 0.0), 1.0);
        for (int64_t n = 0; n < times; ++n)
            row[n] = level[k] * ((1.0 - part) * power.per_hz(i, n) + part * power.per_hz(i + 1, n));
        int64_t j = 0;
        for (int64_t n = 0; n < time_s.size(); ++n) {
            const double t = time_s[n] * rate[k];
            if (t > time[times - 1]) break;
            while (j < times - 2 && time[j + 1] < t) ++j;
            const double between = std::min(std::max((t - time[j]) / (time[j + 1] - time[j]), 0.0), 1.0);
            out[n] = (1.0 - between) * row[j] + between * row[j + 1];
        }
    }
}

}  // namespace engine
