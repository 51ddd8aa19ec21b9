// Python's door to src/radiation.
#include "../radiation/far_field.hpp"
#include "../radiation/panels.hpp"
#include "../radiation/surface_waves.hpp"
#include "arrays.hpp"

namespace engine {

void bind_radiation(nb::module_& m) {
    m.def(
        "sum_patches",
        [](Array<const double, 1> k, Array<const double, 3> moment, Array<const double, 2> place,
           Array<const double, 2> direction, Array<double, 3> ahead, Array<double, 3> behind) {
            const int64_t modes = k.size(), patches = place.shape[1], directions = direction.shape[0];
            check_shape("moment", moment, modes, 7, patches);
            check_shape("place", place, 3, patches);
            check_shape("direction", direction, directions, 3);
            check_shape("ahead", ahead, modes, directions, 2);
            check_shape("behind", behind, modes, directions, 2);
            nb::gil_scoped_release released;
            far_field().sum_patches(k, moment, place, direction, ahead, behind);
        },
        "k"_a, "moment"_a, "place"_a, "direction"_a, "ahead"_a, "behind"_a,
        "Sum what patches send towards directions (n, 3) and their negatives: ahead and behind (m, n, 2), real and\n"
        "imaginary parts.");
    m.def(
        "static_kernels",
        [](Array<const double, 3> corner_m, Array<const double, 2> normal, Array<double, 3> out) {
            const int64_t count = corner_m.shape[0];
            check_shape("corner_m", corner_m, count, 3, 3);
            check_shape("normal", normal, count, 3);
            check_shape("out", out, 4, count, count);
            nb::gil_scoped_release released;
            static_kernels(corner_m, normal, out);
        },
        "corner_m"_a, "normal"_a, "out"_a,
        "Compute 4π times S, K, K', D at k = 0 (4, f, f), [j, i] of triangle j at the centroid of i.");
    m.def(
        "surface_wave_matrices",
        [](double k, double b, Array<const float, 2> place, Array<const float, 3> kernels, Array<float, 3> left,
           Array<float, 3> right) {
            const int64_t count = place.shape[1];
            check_shape("place", place, 7, count);
            check_shape("kernels", kernels, 4, count, count);
            check_shape("left", left, count, count, 2);
            check_shape("right", right, count, count, 2);
            nb::gil_scoped_release released;
            surface_waves().matrices(static_cast<float>(k), static_cast<float>(b), place, kernels, left, right);
        },
        "k"_a, "b"_a, "place"_a, "kernels"_a, "left"_a, "right"_a,
        "Compute 1/2 - K - βD and S + β(1/2 + K') at k, β = ib, each (f, f, 2), [j, i]: real and imaginary parts.");
}

}  // namespace engine
