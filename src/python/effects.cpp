// Python's door to src/effects.
#include "../effects/baseband_sums.hpp"
#include "../effects/ringing.hpp"
#include "arrays.hpp"

namespace engine {

// Check that modes sound in samples that are there: none before the first, however long each rings.
static void check_start(double start, Array<const int64_t, 1> length, const Doubles& sound) {
    if (!(start > -1.0 && start < 1e15)) throw nb::value_error("start: before the first sample, or not a number");
    for (int64_t k = 0; k < length.size(); ++k) check_range("length", length[k], 0, sound.size() + 1);
}

void bind_effects(nb::module_& m) {
    m.def(
        "sum_baseband",
        [](Array<const double, 1> sample, double omega, double theta, Array<Complex, 2> sums) {
            check_shape("sums", sums, 3, sample.size() + 1);
            nb::gil_scoped_release released;
            sum_baseband(sample, omega, theta, sums);
        },
        "sample"_a, "omega"_a, "theta"_a, "sums"_a,
        "Sum y e^{−i(ω − aθ)n} up to each sample (3, n + 1), a = −1, 0, 1; angles in rad a sample.");
    m.def(
        "add_linear_modes",
        [](Array<const Complex, 1> log_pole, Array<const Complex, 1> amplitude, Array<const int64_t, 1> length,
           double start, Doubles sound) {
            check_shape("amplitude", amplitude, log_pole.size());
            check_shape("length", length, log_pole.size());
            check_start(start, length, sound);
            nb::gil_scoped_release released;
            add_linear_modes(log_pole, amplitude, length, start, sound);
        },
        "log_pole"_a, "amplitude"_a, "length"_a, "start"_a, "sound"_a,
        "Add modes (m,) to sound (n,) from the sample start on, each for its length in samples.");
    m.def(
        "add_level_modes",
        [](const LevelModes& modes, Array<const int64_t, 1> length, double start, double sample_rate_hz,
           Doubles sound) {
            const int64_t count = modes.omega_rad_s.size();
            check_shape("decay_per_s", modes.decay_per_s, count);
            check_shape("amplitude", modes.amplitude, count);
            check_shape("bend", modes.bend, count);
            check_shape("damping_growth", modes.damping_growth, count);
            check_shape("length", length, count);
            check_start(start, length, sound);
            nb::gil_scoped_release released;
            add_level_modes(modes, length, start, sample_rate_hz, sound);
        },
        "modes"_a, "length"_a, "start"_a, "sample_rate_hz"_a, "sound"_a,
        "Add modes whose frequency and decay depend on their level to sound (n,).");
}

}  // namespace engine
