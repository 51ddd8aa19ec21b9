#include "fractional_delay.hpp"

#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"

namespace engine {

namespace {

constexpr double PI = std::numbers::pi;
// With 24 taps what a glide adds is below -94 dB up to 0.3 and below -84 dB up to 0.375 of the rate, 18 kHz at 48.
constexpr double KAISER_BETA = 9.5;
constexpr int FIT_POINTS = 64;  // of the fraction: many more than a polynomial's terms

// I₀ by its series Σ ((x/2)^k/k!)²: 40 terms for x ≤ 9.5 [Abramowitz & Stegun 1964, eq. 9.6.12].
double bessel_i0(double x) {
    double sum = 1, term = 1;
    for (int k = 1; k <= 40; ++k) {
        term *= (0.5 * x / k) * (0.5 * x / k);
        sum += term;
    }
    return sum;
}

double sinc(double x) {
    return x == 0 ? 1 : sin(PI * x) / (PI * x);
}

// Taps at t = fraction - ½, of sum 1.
void windowed_sinc(double t, double tap[TAPS]) {
    double sum = 0;
    for (int k = 0; k < TAPS; ++k) {
        const double distance = k - (AHEAD - 1) - (t + 0.5), inside = 1 - (distance / AHEAD) * (distance / AHEAD);
        tap[k] = sinc(distance) * bessel_i0(KAISER_BETA * std::sqrt(inside > 0 ? inside : 0));
        sum += tap[k];
    }
    for (int k = 0; k < TAPS; ++k) tap[k] /= sum;
}

// Least squares on Chebyshev's points 2t = cos θ_i, where the T_2j(2t) = cos 2jθ are orthogonal: each of their
// coefficients is a sum over the points [Mason & Handscomb 2003, eq. 4.45], and T_2j are polynomials in t².
TapPolynomials fit_taps() {
    double even[HALF_DEGREE + 1][2][AHEAD] = {};
    for (int i = 0; i < FIT_POINTS; ++i) {
        const double angle = PI * (i + 0.5) / FIT_POINTS, t = 0.5 * cos(angle);
        double tap[TAPS];
        windowed_sinc(t, tap);
        for (int j = 0; j <= HALF_DEGREE; ++j) {
            const double weight = (j == 0 ? 1.0 : 2.0) / FIT_POINTS * cos(2 * j * angle);
            for (int k = 0; k < AHEAD; ++k) {
                even[j][0][k] += weight * (tap[k] + tap[TAPS - 1 - k]) / 2;
                even[j][1][k] += weight * (tap[k] - tap[TAPS - 1 - k]) / (2 * t);
            }
        }
    }
    // powers of t² in T_2j(2t): T_2j+2 = 2 T_2 T_2j - T_2j-2, T_2 = 8t² - 1
    double term[HALF_DEGREE + 1][HALF_DEGREE + 1] = {{1}, {-1, 8}};
    for (int j = 1; j < HALF_DEGREE; ++j)
        for (int power = 0; power <= HALF_DEGREE; ++power)
            term[j + 1][power] = (power > 0 ? 16 * term[j][power - 1] : 0) - 2 * term[j][power] - term[j - 1][power];
    TapPolynomials fit = {};
    for (int power = 0; power <= HALF_DEGREE; ++power)
        for (int part = 0; part < 2; ++part)
            for (int k = 0; k < AHEAD; ++k)
                for (int j = 0; j <= HALF_DEGREE; ++j) fit.power[power][part][k] += term[j][power] * even[j][part][k];
    return fit;
}

}  // namespace

const TapPolynomials& tap_polynomials() {
    static const TapPolynomials fit = fit_taps();
    return fit;
}

}  // namespace engine
