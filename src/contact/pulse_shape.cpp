#include "pulse_shape.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"
#include "hertz.hpp"

namespace engine {

// Solve δ'' = -δ^(3/2) from δ = 0, δ' = 1 by the classical Runge-Kutta method. The pulse is symmetric, so half of it is
// solved (to δ' = 0) and mirrored: Q(s) + Q(1-s) = 1.
static PulseTable solve_pulse() {
    constexpr int fine = 16, middle = PULSE_CELLS / 2, steps = middle * fine;
    // Half the duration: energy gives δmax = (5/4)^(2/5), and ∫dδ/δ' from 0 to it is δmax ∫du/√(1-u^(5/2)) =
    // δmax √π Γ(2/5)/Γ(9/10) · 2/5
    constexpr double half = 1.6090327298595215;
    constexpr double h = half / steps;
    const auto pull = [](double depth) { return depth > 0.0 ? -(depth * std::sqrt(depth)) : 0.0; };
    PulseTable table{};
    double x = 0.0, v = 1.0;
    for (int step = 1; step <= steps; ++step) {
        const double x1 = v, v1 = pull(x);
        const double x2 = v + h / 2.0 * v1, v2 = pull(x + h / 2.0 * x1);
        const double x3 = v + h / 2.0 * v2, v3 = pull(x + h / 2.0 * x2);
        const double x4 = v + h * v3, v4 = pull(x + h * x3);
        x += h / 6.0 * (x1 + 2.0 * x2 + 2.0 * x3 + x4);
        v += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
        if (step % fine == 0) {
            table.q[step / fine] = (1.0 - v) / 2.0;
            table.force[step / fine] = -pull(x) * half;
        }
    }
    table.q[middle] = 0.5;
    for (int i = 0; i < middle; ++i) {
        table.q[PULSE_CELLS - i] = 1.0 - table.q[i];
        table.force[PULSE_CELLS - i] = table.force[i];
    }
    return table;
}

const PulseTable& pulse_table() {
    static const PulseTable table = solve_pulse();
    return table;
}

double cumulated(double s, bool flat) {
    if (s <= 0.0) return 0.0;
    if (s >= 1.0) return 1.0;
    if (flat) return 0.5 - 0.5 * engine::cos(std::numbers::pi * s);
    const PulseTable& table = pulse_table();
    const int i = std::min(static_cast<int>(s * PULSE_CELLS), PULSE_CELLS - 1);
    const double t = s * PULSE_CELLS - i;
    const double q0 = table.q[i], q1 = table.q[i + 1];
    const double f0 = table.force[i] / PULSE_CELLS, f1 = table.force[i + 1] / PULSE_CELLS;
    return q0 + t * (f0 + t * (3.0 * (q1 - q0) - 2.0 * f0 - f1 + t * (2.0 * (q0 - q1) + f0 + f1)));
}

PulseLength pulse_length(double mass_kg, double modulus_pa, double relative_curvature_per_m, double flat_area_m2,
                         double approach_m_s) {
    const double curvature = relative_curvature_per_m, area = flat_area_m2;
    if (!(curvature > 0.0) && !(area > 0.0)) return {LONGEST_PULSE_S, 0};
    const double curved = curvature > 0.0 ? impact_duration_s(mass_kg, modulus_pa, curvature, approach_m_s) : 0.0;
    const double punch = area > 0.0 ? punch_duration_s(mass_kg, modulus_pa, area) : 0.0;
    const double longer = curved >= punch || std::isnan(punch) ? curved : punch;
    const double tau_s = std::max(std::isnan(longer) ? LONGEST_PULSE_S : longer, SHORTEST_PULSE_S);
    return {std::min(tau_s, LONGEST_PULSE_S), punch >= curved};
}

double rough_stretch(double mass_kg, double modulus_pa, double relative_curvature_per_m, double approach_m_s,
                     double layer_m) {
    const double k = ball_stiffness(modulus_pa, 1.0 / relative_curvature_per_m);
    const double energy = 0.5 * mass_kg * approach_m_s * approach_m_s;
    const double peak = engine::pow(2.5 * energy * engine::pow(k, 2.0 / 3.0), 0.6);
    const double b = layer_m * peak / energy;
    double y = 1.0;
    for (int i = 0; i < 30; ++i) {  // Newton's from above on a convex rising function: it falls to the root
        const double root = engine::pow(y, 2.0 / 3.0);
        y -= (y * root + b * y - 1.0) / (5.0 / 3.0 * root + b);
    }
    return 1.0 / y;
}

double compliance(const double* modal_impulse, const double* frequency_hz, int64_t modes, double tau_s,
                  Array<const double, 1> spectrum) {
    double total = 0.0;
    for (int64_t m = 0; m < modes; ++m) {
        const double cell = frequency_hz[m] * tau_s * SPECTRUM_CELLS_PER_F_TAU;
        if (cell < static_cast<double>(spectrum.size() - 1)) {
            const int64_t at = static_cast<int64_t>(cell);
            const double moved = modal_impulse[m] * (spectrum[at] + (cell - at) * (spectrum[at + 1] - spectrum[at]));
            total += moved * moved;
        }
    }
    return total;
}

}  // namespace engine
