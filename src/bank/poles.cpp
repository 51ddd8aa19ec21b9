#include "poles.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

void set_poles(int64_t b, Array<const Complex, 1> step, Array<const double, 1> separation,
               Array<const double, 2> free_law, const BankTables& bank) {
    const BankBody& body = bank.body[b];
    const Array<double, 2>& coming = bank.coming;
    for (int row = 0; row < 8; ++row) std::fill(&coming(row, 0) + body.start, &coming(row, 0) + body.stop, 0.0);
    for (int64_t k = 0; k < body.columns; ++k) {
        const int64_t m = body.start + k;
        const Complex s = step[k], pole = cexp(s), block = cexp({BLOCK * s.re, BLOCK * s.im});
        const bool same = s.re == free_law(0, m) && s.im == free_law(1, m);
        coming(0, m) = s.re, coming(1, m) = s.im, coming(2, m) = same ? free_law(2, m) : -s.re / s.im;
        coming(3, m) = pole.re, coming(4, m) = pole.im, coming(5, m) = block.re, coming(6, m) = block.im;
        if (separation.size() > 0) coming(7, m) = separation[k];
    }
    bank.ringing[b].fresh = 1;
    if (!is_active(bank.ringing[b])) take_coming(b, bank);
}

void take_coming(int64_t b, const BankTables& bank) {
    if (!bank.ringing[b].fresh) return;
    bank.ringing[b].fresh = 0;
    const int64_t modes = bank.law.shape[1];
    const Array<double, 2>&law = bank.law, &coming = bank.coming;
    for (int64_t m = bank.body[b].start; m < bank.body[b].stop; ++m) {
        for (int i = 0; i < 3; ++i) law(i, m) = coming(i, m);
        bank.pole[m] = coming(3, m), bank.pole[modes + m] = coming(4, m);
        bank.block[m] = coming(5, m), bank.block[modes + m] = coming(6, m);
        law(6, m) = coming(7, m);
    }
}

void bend_poles(int64_t b, int64_t span, const BankTables& bank) {
    constexpr double fastest_turn = 3.141;  // radians a sample: below half the rate
    constexpr double no_fall = 1e-9;        // the mean of a smaller one is 1
    const Doubles &z = bank.z, &driven = bank.driven;
    const int64_t modes = bank.law.shape[1];
    const double length = static_cast<double>(span);
    for (int64_t m = bank.body[b].start; m < bank.body[b].stop; ++m) {
        const double bend = bank.law(3, m), damping_growth = bank.law(4, m), power = bank.law(5, m);
        if (bend == 0 && damping_growth == 0) continue;
        const double decay = -bank.law(0, m) * length, turn = bank.law(1, m);
        const double level = std::sqrt(z[m] * z[m] + z[modes + m] * z[modes + m] + driven[m] * driven[m] +
                                       driven[modes + m] * driven[modes + m]);
        const double c = pow(damping_growth * level, power);
        const double fall = log(std::max((1.0 + c) * exp(power * decay) - c, 1.0)) / power;
        const double mean = fall > no_fall ? -expm1(-2.0 * fall) / (2.0 * fall) : 1.0;
        const double bent = std::min(std::max(turn * (1.0 + bend * level * level * mean), 0.0), fastest_turn);
        const double size = exp(-fall / length);
        bank.pole[m] = size * cos(bent), bank.pole[modes + m] = size * sin(bent);
        if (span == BLOCK) {
            const double all = exp(-fall);
            bank.block[m] = all * cos(bent * BLOCK), bank.block[modes + m] = all * sin(bent * BLOCK);
        }
    }
}

}  // namespace engine
