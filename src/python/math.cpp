// Python's door to src/math.
#include "../math/dense.hpp"
#include "../math/elementary.hpp"
#include "arrays.hpp"

namespace engine {

template <double (*function)(double)>
static void map(Array<const double, 1> x, Array<double, 1> out) {
    check_shape("out", out, x.size());
    for (int64_t i = 0; i < x.size(); ++i) out[i] = function(x[i]);
}

template <double (*function)(double, double)>
static void map_two(Array<const double, 1> x, Array<const double, 1> y, Array<double, 1> out) {
    check_shape("y", y, x.size());
    check_shape("out", out, x.size());
    for (int64_t i = 0; i < x.size(); ++i) out[i] = function(x[i], y[i]);
}

void bind_math(nb::module_& m) {
    m.attr("EIGEN_ROWS") = EIGEN_ROWS;
    m.def("exp_into", &map<exp>, "x"_a, "out"_a, "Compute e^x of each element into out.");
    m.def("expm1_into", &map<expm1>, "x"_a, "out"_a, "Compute e^x - 1 of each element into out.");
    m.def("log_into", &map<log>, "x"_a, "out"_a, "Compute the natural logarithm of each element into out.");
    m.def("log1p_into", &map<log1p>, "x"_a, "out"_a, "Compute log(1 + x) of each element into out.");
    m.def("sin_into", &map<sin>, "x"_a, "out"_a, "Compute the sine of each element into out.");
    m.def("cos_into", &map<cos>, "x"_a, "out"_a, "Compute the cosine of each element into out.");
    m.def("cbrt_into", &map<cbrt>, "x"_a, "out"_a, "Compute the cube root of each element into out.");
    m.def("erf_into", &map<erf>, "x"_a, "out"_a, "Compute the error function of each element into out.");
    m.def("pow_into", &map_two<pow>, "x"_a, "y"_a, "out"_a, "Compute x^y of each element into out.");
    m.def("atan2_into", &map_two<atan2>, "y"_a, "x"_a, "out"_a,
          "Compute the angle of (x, y) of each element into out.");
    m.def("power", &pow, "x"_a, "y"_a, "Compute x^y of two numbers.");
    m.def(
        "cexp_into",
        [](Array<const Complex, 1> z, Array<Complex, 1> out) {
            check_shape("out", out, z.size());
            for (int64_t i = 0; i < z.size(); ++i) out[i] = cexp(z[i]);
        },
        "z"_a, "out"_a, "Compute e^z of each complex element into out.");
    m.def(
        "multiply",
        [](Array<const double, 2> a, Array<const double, 2> b, Array<double, 2> out) {
            check_shape("b", b, a.shape[1], b.shape[1]);
            check_shape("out", out, a.shape[0], b.shape[1]);
            nb::gil_scoped_release released;
            dense().multiply(a, b, out);
        },
        "a"_a, "b"_a, "out"_a, "Multiply matrices (p, q) and (q, r) into out, each sum in the order of q.");
    m.def(
        "eigenpairs",
        [](Array<double, 2> a, Array<double, 1> value, Array<double, 2> scratch) {
            const int64_t n = a.shape[0];
            check_shape("a", a, n, n);
            check_shape("value", value, n);
            check_shape("scratch", scratch, n + EIGEN_ROWS, n);
            nb::gil_scoped_release released;
            return dense().eigenpairs(a, value, scratch);
        },
        "a"_a, "value"_a, "scratch"_a,
        "Turn a symmetric matrix (n, n) into its eigenvectors, by rows, of ascending values (n,); scratch\n"
        "(n + EIGEN_ROWS, n). "
        "Return whether it converged.");
}

}  // namespace engine
