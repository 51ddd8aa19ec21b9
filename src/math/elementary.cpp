// After Sun's fdlibm (K. C. Ng, 1993): its reductions and minimax coefficients, error below 1 ulp each, of erf below 32.
#include "elementary.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace engine {

namespace {

using std::int64_t;
using std::uint64_t;

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

// ln 2 in two parts; products of the first with an exponent are exact
constexpr double LN2_HIGH = 6.93147180369123816490e-01, LN2_LOW = 1.90821492927058770002e-10;
constexpr double PER_LN2 = 1.44269504088896338700e+00;

double high_word(double x) {  // the upper 32 bits, the others zero
    return std::bit_cast<double>(std::bit_cast<uint64_t>(x) & 0xffffffff00000000ULL);
}

double scaled(double x, int64_t exponent) {  // x·2^exponent; two steps where the result is subnormal
    if (exponent > 1023) return x * 0x1p1023 * std::bit_cast<double>(uint64_t(exponent - 1023 + 1023) << 52);
    if (exponent < -1022) return x * std::bit_cast<double>(uint64_t(exponent + 54 + 1023) << 52) * 0x1p-54;
    return x * std::bit_cast<double>(uint64_t(exponent + 1023) << 52);
}

// x - x·P(x²) of the rational form of e^x: c with e^x = 1 + x + x·c/(2 - c)
double exponential_part(double x) {
    const double t = x * x;
    return x - t * (1.66666666666666019037e-01 +
                    t * (-2.77777777770155933842e-03 +
                         t * (6.61375632143793436117e-05 +
                              t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08))));
}

// R with log(1 + f) = f - f²/2 + s·(f²/2 + R), s = f/(2 + f)
double logarithm_part(double s) {
    const double z = s * s, w = z * z;
    const double odd = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    const double even =
        z * (6.666666666666735130e-01 +
             w * (2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    return odd + even;
}

// sin and cos of x + low in ±π/4
double sine_part(double x, double low) {
    const double z = x * x, v = z * x;
    const double r =
        8.33333333332248946124e-03 +
        z * (-1.98412698298579493134e-04 +
             z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    return x - ((z * (0.5 * low - v * r) - low) - v * -1.66666666666666324348e-01);
}

double cosine_part(double x, double low) {
    const double z = x * x;
    const double r = z * (4.16666666666666019037e-02 +
                          z * (-1.38888888888741095749e-03 +
                               z * (2.48015872894767294178e-05 +
                                    z * (-2.75573143513906633035e-07 +
                                         z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)))));
    const double half = 0.5 * z, w = 1.0 - half;
    return w + (((1.0 - w) - half) + (z * r - x * low));
}

struct Quadrant {
    int64_t number;  // of π/2, modulo 4
    double high, low;
};

// 2/π after the point, 64 bits a word: enough for every double, the greatest 1.8e308
constexpr uint64_t TWO_PER_PI[] = {
    0xa2f9836e4e441529ULL, 0xfc2757d1f534ddc0ULL, 0xdb6295993c439041ULL, 0xfe5163abdebbc561ULL, 0xb7246e3a424dd2e0ULL,
    0x06492eea09d1921cULL, 0xfe1deb1cb129a73eULL, 0xe88235f52ebb4484ULL, 0xe99c7026b45f7e41ULL, 0x3991d639835339f4ULL,
    0x9c845f8bbdf9283bULL, 0x1ff897ffde05980fULL, 0xef2f118b5a0a6d1fULL, 0x6d367ecf27cb09b7ULL, 0x4f463f669e5fea2dULL,
    0x7527bac7ebe5f17bULL, 0x3d0739f78a5292eaULL, 0x6bfb5fb11f8d5d08ULL, 0x56033046fc7b6babULL, 0xf0cfbc209af4361dULL,
    0xa9e391615ee61b08ULL, 0x6599855f14a06840ULL,
};

// x - n·π/2 for |x| above 2^20: m·2^e·(2/π) in 192 bits from where its integer part modulo 4 begins [Payne, Hanek
// 1983].
Quadrant reduced_exactly(double x) {
    const uint64_t bits = std::bit_cast<uint64_t>(std::fabs(x));
    const int64_t exponent = int64_t(bits >> 52) - 1075;  // |x| = mantissa·2^exponent
    const uint64_t mantissa = (bits & 0xfffffffffffffULL) | 0x10000000000000ULL;
    // the product's bits above 2^2 are multiples of 4: what is before the word's place `first` is left out
    const int64_t first = exponent > 2 ? exponent - 2 : 0;
    const int64_t word = first / 64, shift = first % 64;
    uint64_t part[4];
    for (int i = 0; i < 4; ++i) {
        part[i] = TWO_PER_PI[word + i] << shift;
        if (shift) part[i] |= TWO_PER_PI[word + i + 1] >> (64 - shift);
    }
    // mantissa · 0.part, modulo 2^64 before the point; the top 64 bits of the fraction in `whole`.. below
    unsigned __int128 carry = (unsigned __int128)mantissa * part[3] >> 64;
    uint64_t digit[3];
    for (int i = 2; i >= 0; --i) {
        carry += (unsigned __int128)mantissa * part[i];
        digit[i] = uint64_t(carry);
        carry >>= 64;
    }
    const uint64_t whole = uint64_t(carry);
    // the value is (whole . digit0 digit1 digit2)·2^left: shift it to the point
    const int64_t left = exponent - first;  // -32 … 2
    uint64_t integer = whole, high = digit[0], low = digit[1];
    if (left > 0) {
        integer = whole << left | digit[0] >> (64 - left);
        high = digit[0] << left | digit[1] >> (64 - left);
        low = digit[1] << left | digit[2] >> (64 - left);
    } else if (left < 0) {
        integer = whole >> -left;
        high = whole << (64 + left) | digit[0] >> -left;
        low = digit[0] << (64 + left) | digit[1] >> -left;
    }
    const bool upper = high >> 63;  // nearer to the next multiple
    if (upper) {
        ++integer;
        low = ~low + 1;
        high = ~high + (low == 0);
    }
    // (high, low)·2^-128 of π/2, to twice a double's precision
    const double a = double(high >> 11) * 0x1p-53, b = (double(high & 0x7ff) * 0x1p53 + double(low >> 11)) * 0x1p-117;
    constexpr double HALF_PI = 1.57079632679489655800e+00, HALF_PI_LOW = 6.12323399573676603587e-17;
    // a·π/2 exactly, by halves of 26 bits
    const double a1 = high_word(a), a2 = a - a1, p1 = high_word(HALF_PI), p2 = HALF_PI - p1;
    const double product = a * HALF_PI;
    const double error = ((a1 * p1 - product) + a1 * p2 + a2 * p1) + a2 * p2;
    const double rest = error + a * HALF_PI_LOW + b * HALF_PI;
    double y = product + rest, z = (product - y) + rest;
    int64_t number = int64_t(integer & 3);
    if (upper) y = -y, z = -z;
    if (x < 0) y = -y, z = -z, number = (4 - number) & 3;
    return {number, y, z};
}

// x - n·π/2, n the nearest: three parts of π/2, of 33 bits each, as many as cancel [Cody, Waite 1980].
Quadrant reduced(double x) {
    if (std::fabs(x) < 7.85398163397448279e-01) return {0, x, 0.0};
    if (std::fabs(x) > 0x1p20) return reduced_exactly(x);
    const double n = std::floor(x * 6.36619772367581382433e-01 + 0.5);
    double r = x - n * 1.57079632673412561417e+00, w = n * 6.07710050650619224932e-11;
    double high = r - w;
    const auto exponent = [](double value) { return int((std::bit_cast<uint64_t>(value) >> 52) & 0x7ff); };
    if (exponent(x) - exponent(high) > 16) {
        const double t = r;
        w = n * 6.07710050630396597660e-11;
        r = t - w;
        w = n * 2.02226624879595063154e-21 - ((t - r) - w);
        high = r - w;
        if (exponent(x) - exponent(high) > 49) {
            const double u = r;
            w = n * 2.02226624871116645580e-21;
            r = u - w;
            w = n * 8.47842766036889956997e-32 - ((u - r) - w);
            high = r - w;
        }
    }
    return {int64_t(n) & 3, high, (r - high) - w};
}

}  // namespace

double exp(double x) {
    if (std::isnan(x)) return x;
    if (x > 7.09782712893383973096e+02) return INFINITE;
    if (x < -7.45133219101941108420e+02) return 0.0;
    const double k = std::fabs(x) > 0.34657359027997264 ? std::floor(PER_LN2 * x + 0.5) : 0.0;
    const double high = x - k * LN2_HIGH, low = k * LN2_LOW;
    const double r = high - low, c = exponential_part(r);
    if (k == 0.0) return 1.0 - ((r * c) / (c - 2.0) - r);
    return scaled(1.0 - ((low - (r * c) / (2.0 - c)) - high), int64_t(k));
}

double expm1(double x) {
    if (std::isnan(x)) return x;
    if (x > 7.09782712893383973096e+02) return INFINITE;
    if (x < -40.0) return -1.0;
    if (std::fabs(x) < 0x1p-54) return x;
    const double k = std::fabs(x) > 0.34657359027997264 ? std::floor(PER_LN2 * x + 0.5) : 0.0;
    const double high = x - k * LN2_HIGH, low = k * LN2_LOW;
    const double r = high - low, c = (high - r) - low;
    const double half = 0.5 * r, square = r * half;
    const double q =
        1.0 +
        square * (-3.33333333333331316428e-02 +
                  square * (1.58730158725481460165e-03 +
                            square * (-7.93650757867487942473e-05 +
                                      square * (4.00821782732936239552e-06 + square * -2.01099218183624371326e-07))));
    const double t = 3.0 - q * half;
    double e = square * ((q - t) / (6.0 - r * t));
    if (k == 0.0) return r - (r * e - square);
    e = r * (e - c) - c;
    e -= square;
    if (k == -1.0) return 0.5 * (r - e) - 0.5;
    if (k == 1.0) return r < -0.25 ? -2.0 * (e - (r + 0.5)) : 1.0 + 2.0 * (r - e);
    if (k <= -2.0 || k > 56.0) return scaled(1.0 - (e - r), int64_t(k)) - 1.0;
    if (k < 20.0) return scaled((1.0 - scaled(1.0, -int64_t(k))) - (e - r), int64_t(k));
    return scaled((r - (e + scaled(1.0, -int64_t(k)))) + 1.0, int64_t(k));
}

double log(double x) {
    if (std::isnan(x) || x < 0.0) return NOT_A_NUMBER;
    if (x == 0.0) return -INFINITE;
    if (x == INFINITE) return x;
    int64_t k = 0;
    if (x < 0x1p-1022) x *= 0x1p54, k = -54;
    uint64_t bits = std::bit_cast<uint64_t>(x);
    bits += 0x3ff0000000000000ULL - 0x3fe6a09e00000000ULL;  // from √½ to √2
    k += int64_t(bits >> 52) - 1023;
    bits = (bits & 0x000fffffffffffffULL) + 0x3fe6a09e00000000ULL;
    const double f = std::bit_cast<double>(bits) - 1.0, half = 0.5 * f * f, s = f / (2.0 + f), e = double(k);
    return s * (half + logarithm_part(s)) + e * LN2_LOW - half + f + e * LN2_HIGH;
}

double log1p(double x) {
    if (std::isnan(x) || x < -1.0) return NOT_A_NUMBER;
    if (x == -1.0) return -INFINITE;
    if (std::fabs(x) < 0x1p-54) return x;
    if (x == INFINITE) return x;
    double f = x, c = 0.0, e = 0.0;
    if (x < -0.2928932188134524 || x > 0.4142135623730950) {
        const double u = 1.0 + x;
        uint64_t bits = std::bit_cast<uint64_t>(u) + (0x3ff0000000000000ULL - 0x3fe6a09e00000000ULL);
        const int64_t k = int64_t(bits >> 52) - 1023;
        if (k < 54) c = (k >= 2 ? 1.0 - (u - x) : x - (u - 1.0)) / u;
        bits = (bits & 0x000fffffffffffffULL) + 0x3fe6a09e00000000ULL;
        f = std::bit_cast<double>(bits) - 1.0, e = double(k);
    }
    const double half = 0.5 * f * f, s = f / (2.0 + f);
    return s * (half + logarithm_part(s)) + (e * LN2_LOW + c) - half + f + e * LN2_HIGH;
}

double sin(double x) {
    if (!std::isfinite(x)) return NOT_A_NUMBER;
    const Quadrant at = reduced(x);
    const double value = at.number & 1 ? cosine_part(at.high, at.low) : sine_part(at.high, at.low);
    return at.number & 2 ? -value : value;
}

double cos(double x) {
    if (!std::isfinite(x)) return NOT_A_NUMBER;
    const Quadrant at = reduced(x);
    const double value = at.number & 1 ? sine_part(at.high, at.low) : cosine_part(at.high, at.low);
    return at.number == 1 || at.number == 2 ? -value : value;
}

// x^y = 2^(y·log2 x), log2 x to 20 bits more than a double [fdlibm e_pow.c]. x ≥ 0: a root of what is negative is no
// number.
double pow(double x, double y) {
    if (y == 0.0 || x == 1.0) return 1.0;
    if (std::isnan(x) || std::isnan(y)) return NOT_A_NUMBER;
    if (std::fabs(y) == 1.0) return y > 0 ? x : 1.0 / x;
    if (y == 2.0) return x * x;
    if (y == 0.5 && x >= 0.0) return std::sqrt(x);
    double sign = 1.0;
    if (x < 0.0) {
        if (std::floor(y) != y) return NOT_A_NUMBER;
        if (std::fmod(y, 2.0) != 0.0) sign = -1.0;
        x = -x;
    }
    if (x == 0.0) return y > 0 ? sign * 0.0 : sign * INFINITE;
    if (x == INFINITE) return y > 0 ? sign * INFINITE : sign * 0.0;
    if (std::fabs(y) == INFINITE) return (x > 1.0) == (y > 0) ? (x == 1.0 ? 1.0 : INFINITE) : (x == 1.0 ? 1.0 : 0.0);
    if (std::fabs(y) > 0x1p64) return (x > 1.0) == (y > 0) ? sign * INFINITE : sign * 0.0;
    int64_t n = 0;
    if (x < 0x1p-1022) x *= 0x1p53, n = -53;
    uint64_t bits = std::bit_cast<uint64_t>(x);
    n += int64_t(bits >> 52) - 1023;
    const uint64_t top = (bits >> 32) & 0xfffff;
    int k = 0;  // x is 1 or 3/2 times what is near 1
    bits = (bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL;
    if (top > 0x3988e) {
        if (top < 0xbb67a) {
            k = 1;
        } else {
            ++n;
            bits -= 0x10000000000000ULL;
        }
    }
    const double a = std::bit_cast<double>(bits), base = k ? 1.5 : 1.0;
    const double u = a - base, v = 1.0 / (a + base), ss = u * v, s_high = high_word(ss);
    const double sum_high = high_word(a + base), sum_low = a - (sum_high - base);
    const double s_low = v * ((u - s_high * sum_high) - s_high * sum_low);
    const double s2 = ss * ss;
    double r = s2 * s2 *
               (5.99999999999994648725e-01 +
                s2 * (4.28571428578550184252e-01 +
                      s2 * (3.33333329818377432918e-01 +
                            s2 * (2.72728123808534006489e-01 +
                                  s2 * (2.30660745775561754067e-01 + s2 * 2.06975017800338417784e-01)))));
    r += s_low * (s_high + ss);
    const double square = s_high * s_high, third_high = high_word(3.0 + square + r),
                 third_low = r - ((third_high - 3.0) - square);
    const double p = s_high * third_high, q = s_low * third_high + third_low * ss;
    const double p_high = high_word(p + q), p_low = q - (p_high - p);
    const double z_high = 9.61796700954437255859e-01 * p_high;  // 2/(3 ln 2) in two parts
    const double z_low = -7.02846165095275826516e-09 * p_high + p_low * 9.61796693925975554329e-01 +
                         (k ? 1.35003920212974897128e-08 : 0.0);
    const double offset = k ? 5.84962487220764160156e-01 : 0.0;  // log2 3/2
    const double whole = double(n);
    const double t1 = high_word(((z_high + z_low) + offset) + whole);
    const double t2 = z_low - (((t1 - whole) - offset) - z_high);
    const double y1 = high_word(y);
    const double low = (y - y1) * t1 + y * t2, high = y1 * t1, exponent = low + high;
    const double above = exponent - high;
    if (exponent > 1024.0 || (exponent == 1024.0 && low + 8.0085662595372944372e-17 > above)) return sign * INFINITE;
    if (exponent < -1075.0 || (exponent == -1075.0 && low <= above)) return sign * 0.0;
    const double m = std::fabs(exponent) > 0.5 ? std::floor(exponent + 0.5) : 0.0;
    const double rest = high - m, t = high_word(low + rest);
    const double g = t * 6.93147182464599609375e-01;
    const double h = (low - (t - rest)) * 6.93147180559945286227e-01 + t * -1.90465429995776804525e-09;
    const double z = g + h, w = h - (z - g), c = exponential_part(z);
    const double e = (z * c) / (c - 2.0) - (w + z * w);
    return sign * scaled(1.0 - (e - z), int64_t(m));
}

double cbrt(double x) {
    if (x == 0.0 || !std::isfinite(x)) return x;
    uint64_t bits = std::bit_cast<uint64_t>(std::fabs(x));
    double scale = 1.0;
    double size = std::fabs(x);
    if (size < 0x1p-1022) size *= 0x1p54, bits = std::bit_cast<uint64_t>(size), scale = 0x1p-18;
    double t = std::bit_cast<double>((((bits >> 32) / 3 + 715094163) << 32));
    double r = (t * t) * (t / size);  // to 23 bits
    t = t * ((1.87595182427177009643 + r * (-1.88497979543377169875 + r * 1.621429720105354466140)) +
             ((r * r) * r) * (-0.758397934778766047437 + r * 0.145996192886612446982));
    t = std::bit_cast<double>((std::bit_cast<uint64_t>(t) + 0x80000000ULL) & 0xffffffffc0000000ULL);
    r = size / (t * t);  // one step of Newton
    r = (r - t) / (t + t + r);
    t = (t + t * r) * scale;
    return x < 0 ? -t : t;
}

namespace {

double arctangent(double x) {  // of x ≥ 0
    constexpr double HIGH[] = {4.63647609000806093515e-01, 7.85398163397448278999e-01, 9.82793723247329054082e-01,
                               1.57079632679489655800e+00};
    constexpr double LOW[] = {2.26987774529616870924e-17, 3.06161699786838301793e-17, 1.39033110312309984516e-17,
                              6.12323399573676603587e-17};
    if (x >= 0x1p66) return HIGH[3];
    int piece = -1;
    if (x >= 0.4375) {
        if (x < 0.6875) {
            piece = 0, x = (2.0 * x - 1.0) / (2.0 + x);
        } else if (x < 1.1875) {
            piece = 1, x = (x - 1.0) / (x + 1.0);
        } else if (x < 2.4375) {
            piece = 2, x = (x - 1.5) / (1.0 + 1.5 * x);
        } else {
            piece = 3, x = -1.0 / x;
        }
    }
    const double z = x * x, w = z * z;
    const double odd = z * (3.33333333333329318027e-01 +
                            w * (1.42857142725034663711e-01 +
                                 w * (9.09088713343650656196e-02 +
                                      w * (6.66107313738753120669e-02 +
                                           w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)))));
    const double even =
        w *
        (-1.99999999998764832476e-01 +
         w * (-1.11111104054623557880e-01 +
              w * (-7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
    if (piece < 0) return x - x * (odd + even);
    return HIGH[piece] - ((x * (odd + even) - LOW[piece]) - x);
}

}  // namespace

double atan2(double y, double x) {
    constexpr double PI = 3.14159265358979311600, PI_LOW = 1.2246467991473531772e-16;
    if (std::isnan(x) || std::isnan(y)) return NOT_A_NUMBER;
    const bool below = std::signbit(y), behind = std::signbit(x);
    double angle;
    if (y == 0.0) {
        angle = 0.0;
    } else if (x == 0.0 || (std::isinf(y) && !std::isinf(x))) {
        return below ? -0.5 * PI : 0.5 * PI;
    } else if (std::isinf(x)) {
        angle = std::isinf(y) ? 0.25 * PI : 0.0;
    } else {
        const double slope = std::fabs(y / x);
        angle = slope > 0x1p64 ? 0.5 * PI + 0.5 * PI_LOW : arctangent(slope);
    }
    if (behind) angle = std::isinf(x) && std::isinf(y) ? 0.75 * PI : PI - (angle - PI_LOW);
    return below ? -angle : angle;
}

// Below 3 by the series of positive terms (DLMF 7.6.2), above by 1 less Laplace's continued fraction (DLMF 7.9.1).
double erf(double x) {
    constexpr double ROOT_PI = 1.77245385090551602730;
    const double size = std::fabs(x), square = size * size;
    if (std::isnan(x)) return x;
    const double front = high_word(size);  // e^(-size²), whose square is exact in parts
    const double fall = exp(-front * front) * exp((front - size) * (front + size));
    double value = 1.0;
    if (size < 3.0) {
        double term = 1.0, sum = 1.0;
        for (int n = 1; term > 1e-18 * sum; ++n) {
            term *= 2.0 * square / (2 * n + 1);
            sum += term;
        }
        value = 2.0 / ROOT_PI * size * fall * sum;
    } else if (size < 6.0) {
        double tail = size;
        for (int n = 40; n > 0; --n) tail = size + 0.5 * n / tail;
        value = 1.0 - fall / (ROOT_PI * tail);
    }
    return x < 0 ? -value : value;
}

Complex cexp(Complex z) {
    const double size = exp(z.re);
    return {size * cos(z.im), size * sin(z.im)};
}

}  // namespace engine
