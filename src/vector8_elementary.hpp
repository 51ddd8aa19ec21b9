// Logarithm and angle of eight doubles, within 2 ulp; beside vector8.hpp, for NAME_vector.cpp alone.
//
// Rational approximations of Cephes [Moshier 1989, Methods and Programs for Mathematical Functions, ch. 3 and 5].
#pragma once

#include <limits>
#include <numbers>

#include "vector8_compare.hpp"

namespace engine::VECTOR_LEVEL {

VECTOR_INLINE Double8 doubles_of(const Bits8& bits) {
    Double8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = reinterpret_cast<Part>(bits.part[i]);
    return out;
}

template <int terms>
VECTOR_INLINE Double8 polynomial(const double (&highest_first)[terms], const Double8& x) {
    Double8 sum = broadcast(highest_first[0]);
#pragma GCC unroll 8
    for (int i = 1; i < terms; ++i) sum = sum * x + broadcast(highest_first[i]);
    return sum;
}

// ln x: of normal numbers; inf of inf, NaN of what is not above 0.
VECTOR_INLINE Double8 log(const Double8& x) {
    static constexpr double above[] = {1.01875663804580931796E-4, 4.97494994976747001425E-1, 4.70579119878881725854E0,
                                       1.44989225341610930846E1,  1.79368678507819816313E1,  7.70838733755885391666E0};
    static constexpr double below[] = {1.0,
                                       1.12873587189167450590E1,
                                       4.52279145837532221105E1,
                                       8.29875266912776603211E1,
                                       7.11544750618563894466E1,
                                       2.31251620126765340583E1};
    constexpr double infinite = std::numeric_limits<double>::infinity();
    // x = m 2^e, m in [√½, √2): e by way of a double whose last bits are it
    constexpr int64_t fraction = 0x000fffffffffffff, half = 0x3fe0000000000000, whole = 0x4330000000000000;
    const Bits8 bits = bits_of(x);
    Bits8 of_m, of_e;
    for (int i = 0; i < PARTS; ++i) {
        of_m.part[i] = (bits.part[i] & fraction) | half;
        of_e.part[i] = (bits.part[i] >> 52) | whole;
    }
    Double8 m = doubles_of(of_m), e = doubles_of(of_e) - broadcast(4503599627370496.0 + 1022.0);
    const Bits8 low = m < broadcast(0.70710678118654752440);
    e = choose(low, e - broadcast(1.0), e);
    m = choose(low, m + m, m) - broadcast(1.0);
    const Double8 z = m * m;
    Double8 y = m * (z * polynomial(above, m) / polynomial(below, m));
    y = y - e * broadcast(2.121944400546905827679e-4) - broadcast(0.5) * z;  // ln 2 in two parts
    const Double8 found = m + y + e * broadcast(0.693359375);
    const Double8 beyond =
        choose(broadcast(0.0) < x, broadcast(infinite), broadcast(std::numeric_limits<double>::quiet_NaN()));
    return choose((broadcast(0.0) < x) & (x < broadcast(infinite)), found, beyond);
}

// The angle of (x, y), -π … π; of (0, 0) 0.
VECTOR_INLINE Double8 atan2(const Double8& y, const Double8& x) {
    static constexpr double above[] = {-8.750608600031904122785E-1, -1.615753718733365076637E1,
                                       -7.500855792314704667340E1, -1.228866684490136173410E2,
                                       -6.485021904942025371773E1};
    static constexpr double below[] = {1.0,
                                       2.485846490142306297962E1,
                                       1.650270098316988542046E2,
                                       4.328810604912902668951E2,
                                       4.853903996359136964868E2,
                                       1.945506571482613964425E2};
    constexpr double pi = std::numbers::pi;
    const Double8 zero = broadcast(0.0), one = broadcast(1.0);
    const Double8 tall = choose(y < zero, zero - y, y), wide = choose(x < zero, zero - x, x);
    const Bits8 steep = wide < tall;
    const Double8 more = choose(steep, tall, wide), less = choose(steep, wide, tall);
    const Double8 ratio = choose(zero < more, less / choose(zero < more, more, one), more + less);  // and what is NaN
    const Bits8 middle = broadcast(0.66) < ratio;
    const Double8 t = choose(middle, (ratio - one) / (ratio + one), ratio), z = t * t;
    Double8 angle = t + t * (z * polynomial(above, z) / polynomial(below, z));
    angle = choose(middle, angle + broadcast(0.25 * pi), angle);
    angle = choose(steep, broadcast(0.5 * pi) - angle, angle);
    angle = choose(x < zero, broadcast(pi) - angle, angle);
    return choose(y < zero, zero - angle, angle);
}

}  // namespace engine::VECTOR_LEVEL
