#include "noise_grain.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

namespace {

constexpr double LEAST_POWER = 1e-6;  // over the most: -60 dB, what is below is not heard
constexpr double LN_10 = 2.30258509299404568402;

// Values (k,) on a grid of `every` finer bins, linear between.
struct Interpolated {
    Array<const float, 1> value;
    int64_t every;

    float operator()(int64_t bin) const {
        const int64_t low = std::min(bin / every, value.size() - 2);
        const float part = static_cast<float>(bin - low * every) / static_cast<float>(every);
        return value[low] + part * (value[low + 1] - value[low]);
    }
};

}  // namespace

void count_level_steps(Array<const double, 1> power, double most, double step_db, Array<std::int16_t, 1> step) {
    const double least = most * LEAST_POWER;
    for (int64_t p = 0; p < power.size(); ++p)
        step[p] =
            static_cast<std::int16_t>(std::nearbyint(10.0 * (log(std::max(power[p], least) / most) / LN_10) / step_db));
}

void mix_grains(Array<const float, 2> grains, float first, float second, Array<float, 1> mixed) {
    for (int64_t n = 0; n < mixed.size(); ++n) mixed[n] = first * grains(0, n) + second * grains(1, n);
}

void filter_grains(Array<const ComplexFloat, 2> base, Array<const float, 1> gain, Array<ComplexFloat, 2> filtered) {
    const Interpolated factor{gain, (base.shape[1] - 1) / (gain.size() - 1)};
    for (int64_t k = 0; k < base.shape[1]; ++k) {
        const float value = factor(k);
        for (int64_t v = 0; v < base.size(); ++v) filtered(v, k) = {base(v, k).re * value, base(v, k).im * value};
    }
}

void shape_spectrum(Array<ComplexFloat, 1> spectrum, Array<const ComplexFloat, 2> base, Array<const float, 1> first,
                    Array<const float, 1> second) {
    const int64_t every = (base.shape[1] - 1) / (first.size() - 1);
    const Interpolated one{first, every}, two{second, every};
    for (int64_t k = 0; k < base.shape[1]; ++k) {
        const float a = one(k), b = two(k);
        const ComplexFloat u = base(0, k), v = base(1, k), s = spectrum[k];
        const float re = a * u.re + b * v.re, im = a * u.im + b * v.im;
        spectrum[k] = {s.re * re - s.im * im, s.re * im + s.im * re};
    }
}

}  // namespace engine
