// Elementary functions of our own: what libm returns differs between machines and releases, these do not.
//
// Each is within 1 ulp of the exact value, erf within 32 (tests/engine/compiled/test_elementary.py); sqrt, floor, ceil, fabs are IEEE
// operations and come from <cmath>.
#pragma once

namespace engine {

double exp(double x);
double expm1(double x);
double log(double x);
double log1p(double x);
double sin(double x);
double cos(double x);
double pow(double x, double y);
double cbrt(double x);
double atan2(double y, double x);
double erf(double x);  // within 32 ulp: a long sum

struct Complex {
    double re, im;
};
struct ComplexFloat {
    float re, im;
};

Complex cexp(Complex z);  // e^z

}  // namespace engine
