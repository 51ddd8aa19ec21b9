#include "octave_heights.hpp"

#include <cmath>
#include <numbers>

#include "../math/elementary.hpp"

namespace engine {

void height_octaves(double roughness_m, double hurst, Octaves& height_m) {
    double total = 0.0;
    for (int j = 0; j < OCTAVES; ++j) {
        height_m[j] = engine::pow(WAVE_M[j], hurst);
        total += height_m[j] * height_m[j];
    }
    const double scale = std::sqrt(total);
    for (double& height : height_m) height = roughness_m * (height / scale) * UNIT_RMS;
}

void given_octaves(const Octaves& octave_rms_m, Octaves& height_m) {
    for (int j = 0; j < OCTAVES; ++j) height_m[j] = octave_rms_m[j] * UNIT_RMS;
}

void add_waves(double rms_m, double length_m, Octaves& height_m) {
    if (!(rms_m > 0.0)) return;
    const double octave = std::floor(engine::log(LONGEST_WAVE_M / length_m) / std::numbers::ln2 + 0.5);
    if (!(octave >= 0.0 && octave < OCTAVES)) return;
    double& height = height_m[static_cast<int>(octave)];
    height = std::sqrt(height * height + rms_m * rms_m * (UNIT_RMS * UNIT_RMS));
}

double slope_squared(const Octaves& height_m) {
    double total = 0.0;
    for (int j = 0; j < OCTAVES; ++j) {
        const double slope = 2.0 * std::numbers::pi / WAVE_M[j] * height_m[j] / UNIT_RMS;
        total += slope * slope;
    }
    return total;
}

double reach_of_ball(double wave_m, double patch_radius_m, double radius_m) {
    const double rise_m2 = wave_m * wave_m / 16.0 + patch_radius_m * patch_radius_m;
    return rise_m2 / radius_m / std::numbers::sqrt2 * UNIT_RMS;
}

ClosedLattice close_round(double length_m, Octaves& height_m) {
    double points = length_m / (LONGEST_WAVE_M * OCTAVE_LATTICE), finer = 1.0;
    for (int j = 0; points < 4.0 && j < OCTAVES - 1; ++j) {
        points *= 2.0, finer *= 2.0;
        height_m[j] = 0.0;
    }
    const double whole = std::floor(points + 0.5);
    return {whole / finer, whole / points - 1.0};
}

}  // namespace engine
