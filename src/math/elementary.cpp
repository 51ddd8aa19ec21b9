#include "elementary.hpp"

// PLACEHOLDER until the branch of the engine has its own: libm's
#include <cmath>

namespace engine {
double exp(double x) { return std::exp(x); }
double expm1(double x) { return std::expm1(x); }
double log(double x) { return std::log(x); }
double log1p(double x) { return std::log1p(x); }
double sin(double x) { return std::sin(x); }
double cos(double x) { return std::cos(x); }
double pow(double x, double y) { return std::pow(x, y); }
double cbrt(double x) { return std::cbrt(x); }
double atan2(double y, double x) { return std::atan2(y, x); }
double erf(double x) { return std::erf(x); }
Complex cexp(Complex z) {
    const double size = exp(z.re);
    return {size * cos(z.im), size * sin(z.im)};
}
}  // namespace engine
