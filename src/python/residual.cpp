// Python's door to src/residual.
#include "../residual/noise_grain.hpp"
#include "../residual/spectrogram_maps.hpp"
#include "arrays.hpp"

namespace engine {

// Check that a grid of k bins spans another of F finer ones: a whole number of them between two bins.
static void check_grid(const char* name, int64_t coarse, int64_t fine) {
    check_range(name, coarse, 2, fine + 1);
}

static void bind_grains(nb::module_& m) {
    m.def(
        "count_level_steps",
        [](Array<const double, 1> power, double most, double step_db, Array<std::int16_t, 1> step) {
            check_range("step", step.size(), power.size(), INT64_MAX);
            count_level_steps(power, most, step_db, step);
        },
        "power"_a, "most"_a, "step_db"_a, "step"_a,
        "Write levels of power (p,) below the most, in whole steps of step_db, to the first of step.");
    m.def(
        "mix_grains",
        [](Array<const float, 2> grains, float first, float second, Array<float, 1> mixed) {
            check_shape("grains", grains, 2, mixed.size());
            mix_grains(grains, first, second, mixed);
        },
        "grains"_a, "first"_a, "second"_a, "mixed"_a, "Fill mixed (n,) with first·grains[0] + second·grains[1].");
    m.def(
        "filter_grains",
        [](Array<const ComplexFloat, 2> base, Array<const float, 1> gain, Array<ComplexFloat, 2> filtered) {
            check_grid("gain", gain.size(), base.shape[1]);
            check_shape("filtered", filtered, base.size(), base.shape[1]);
            nb::gil_scoped_release released;
            filter_grains(base, gain, filtered);
        },
        "base"_a, "gain"_a, "filtered"_a,
        "Fill filtered (v, F) with base·gain, the gain (k,) linear between its bins.");
    m.def(
        "shape_spectrum",
        [](Array<ComplexFloat, 1> spectrum, Array<const ComplexFloat, 2> base, Array<const float, 1> first,
           Array<const float, 1> second) {
            check_grid("first", first.size(), base.shape[1]);
            check_shape("second", second, first.size());
            check_shape("base", base, 2, spectrum.size());
            nb::gil_scoped_release released;
            shape_spectrum(spectrum, base, first, second);
        },
        "spectrum"_a, "base"_a, "first"_a, "second"_a,
        "Multiply a spectrum (F,) by first·base_0 + second·base_1, first and second (k,) linear between their bins.");
}

void bind_residual(nb::module_& m) {
    bind_grains(m);
    m.def(
        "add_damped_lines",
        [](Array<const Complex, 1> pole, Array<const Complex, 1> amplitude, Array<const int64_t, 1> length,
           Doubles sound) {
            check_shape("amplitude", amplitude, pole.size());
            check_shape("length", length, pole.size());
            for (int64_t k = 0; k < length.size(); ++k) check_range("length", length[k], 0, sound.size() + 1);
            nb::gil_scoped_release released;
            add_damped_lines(pole, amplitude, length, sound);
        },
        "pole"_a, "amplitude"_a, "length"_a, "sound"_a,
        "Add Re a p^n of lines (l,) to sound (n,), each for its length in samples.");
    m.def(
        "renew_phases",
        [](Array<ComplexFloat, 2> spectrum, Array<ComplexFloat, 2> before, Array<const float, 2> magnitude,
           float momentum) {
            check_shape("spectrum", spectrum, magnitude.size(), magnitude.shape[1]);
            check_shape("before", before, magnitude.size(), magnitude.shape[1]);
            nb::gil_scoped_release released;
            renew_phases(spectrum, before, magnitude, momentum);
        },
        "spectrum"_a, "before"_a, "magnitude"_a, "momentum"_a,
        "Give a spectrum (m, k) its magnitudes again, its phases moved on with momentum.");
    m.def(
        "power_ratios",
        [](Array<const double, 1> freq_hz, Array<const double, 1> centre_hz, Array<const double, 1> half_hz,
           Array<const double, 1> source_power, Array<const double, 1> target_power, Doubles ratio) {
            check_shape("half_hz", half_hz, centre_hz.size());
            check_shape("source_power", source_power, centre_hz.size());
            check_shape("target_power", target_power, centre_hz.size());
            check_shape("ratio", ratio, freq_hz.size());
            nb::gil_scoped_release released;
            power_ratios(freq_hz, centre_hz, half_hz, source_power, target_power, ratio);
        },
        "freq_hz"_a, "centre_hz"_a, "half_hz"_a, "source_power"_a, "target_power"_a, "ratio"_a,
        "Compute the ratio (k,) of two bodies' modal power at frequencies (k,), from pairs (p,) of modes.");
    m.def(
        "move_power",
        [](Array<const double, 1> freq_hz, Array<const double, 1> time_s, Array<const double, 2> per_hz,
           Array<const double, 1> source_hz, Array<const double, 1> level, Array<const double, 1> rate,
           Array<const double, 1> at_s, Doubles row, Array<double, 2> moved) {
            check_range("freq_hz", freq_hz.size(), 2, INT64_MAX);
            check_range("time_s", time_s.size(), 2, INT64_MAX);
            check_shape("per_hz", per_hz, freq_hz.size(), time_s.size());
            check_shape("level", level, source_hz.size());
            check_shape("rate", rate, source_hz.size());
            check_shape("row", row, time_s.size());
            check_shape("moved", moved, source_hz.size(), at_s.size());
            nb::gil_scoped_release released;
            move_power({freq_hz, time_s, per_hz}, source_hz, level, rate, at_s, row, moved);
        },
        "freq_hz"_a, "time_s"_a, "per_hz"_a, "source_hz"_a, "level"_a, "rate"_a, "at_s"_a, "row"_a, "moved"_a,
        "Compute level·P(source_hz, rate·at_s) (k, n) of a power spectrogram (b, t).");
}

}  // namespace engine
