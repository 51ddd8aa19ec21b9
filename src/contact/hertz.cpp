#include "hertz.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"

namespace engine {

double contact_modulus(double low_pa, double high_pa) {
    return 1.0 / (1.0 / low_pa + 1.0 / high_pa);
}

double ball_stiffness(double modulus_pa, double radius_m) {
    return 4.0 / 3.0 * modulus_pa * std::sqrt(radius_m);
}

double ball_patch_m(double load_n, double modulus_pa, double radius_m) {
    return engine::pow(0.75 * load_n * radius_m / modulus_pa, 1.0 / 3.0);
}

double impact_depth_m(double mass_kg, double stiffness, double approach_m_s) {
    return engine::pow(1.25 * mass_kg * approach_m_s * approach_m_s / stiffness, 0.4);
}

double impact_duration_s(double mass_kg, double modulus_pa, double relative_curvature_per_m, double approach_m_s) {
    const double fifth =
        mass_kg * mass_kg * relative_curvature_per_m / (modulus_pa * modulus_pa * std::max(approach_m_s, 0.0));
    return 2.868 * engine::pow(fifth, 0.2);
}

double punch_duration_s(double mass_kg, double modulus_pa, double area_m2) {
    constexpr double pi = std::numbers::pi;
    return pi * std::sqrt(mass_kg / (2.0 * modulus_pa * std::sqrt(area_m2 / pi)));
}

}  // namespace engine
