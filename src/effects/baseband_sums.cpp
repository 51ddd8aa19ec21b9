#include "baseband_sums.hpp"

#include <algorithm>

#include "ringing.hpp"

namespace engine {

void sum_baseband(Array<const double, 1> sample, double omega, double theta, Array<Complex, 2> sums) {
    for (int64_t a = 0; a < 3; ++a) {
        const double step = omega - static_cast<double>(a - 1) * theta;
        const Complex turn = cexp({-0.0, -step});
        const Array<Complex, 1> out = sums[a];
        Complex total{0, 0};
        out[0] = total;
        for (int64_t block = 0; block < sample.size(); block += EXACT_EVERY) {
            Complex phasor = cexp({-0.0, -step * static_cast<double>(block)});
            const int64_t stop = std::min(block + EXACT_EVERY, sample.size());
            for (int64_t n = block; n < stop; ++n) {
                total.re += sample[n] * phasor.re;
                total.im += sample[n] * phasor.im;
                phasor = {phasor.re * turn.re - phasor.im * turn.im, phasor.re * turn.im + phasor.im * turn.re};
                out[n + 1] = total;
            }
        }
    }
}

}  // namespace engine
