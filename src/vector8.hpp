// Eight doubles at once: one, two or four registers, the same bits. For NAME_vector.cpp files alone.
//
// Products and sums are rounded apart (no fused multiply-add), and `total` adds halves: what a lane holds and what a
// sum is does not depend on the width of the registers.
#pragma once

#include <cstring>

#include "flush.hpp"
#include "vector_level.hpp"

#ifndef VECTOR_LEVEL
#error "vector8.hpp: for NAME_vector.cpp files alone, which are compiled once a level"
#endif

namespace engine {

namespace VECTOR_LEVEL {

#if defined(__AVX512F__)
constexpr int PARTS = 1;
#elif defined(__AVX__)
constexpr int PARTS = 2;
#else
constexpr int PARTS = 4;
#endif
typedef double Part __attribute__((vector_size(8 * LANES / PARTS)));
typedef double PartInMemory __attribute__((vector_size(8 * LANES / PARTS), aligned(8), may_alias));

struct Double8 {
    Part part[PARTS];
};

#define VECTOR_INLINE inline __attribute__((always_inline))

VECTOR_INLINE Double8 load(const double* from) {
    Double8 out;
    const PartInMemory* parts = reinterpret_cast<const PartInMemory*>(from);
    for (int i = 0; i < PARTS; ++i) out.part[i] = parts[i];
    return out;
}
VECTOR_INLINE void store(double* to, const Double8& value) {
    PartInMemory* parts = reinterpret_cast<PartInMemory*>(to);
    for (int i = 0; i < PARTS; ++i) parts[i] = value.part[i];
}
VECTOR_INLINE Double8 broadcast(double value) {
    Double8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = value - Part{};
    return out;
}
VECTOR_INLINE Double8 operator+(Double8 a, const Double8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] += b.part[i];
    return a;
}
VECTOR_INLINE Double8 operator-(Double8 a, const Double8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] -= b.part[i];
    return a;
}
VECTOR_INLINE Double8 operator*(Double8 a, const Double8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] *= b.part[i];
    return a;
}
VECTOR_INLINE Double8 operator/(Double8 a, const Double8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] /= b.part[i];
    return a;
}
VECTOR_INLINE Double8 operator-(Double8 a) {
    for (int i = 0; i < PARTS; ++i) a.part[i] = -a.part[i];
    return a;
}
// value in the lanes where a >= b, else 0.
VECTOR_INLINE Double8 where_at_least(const Double8& a, const Double8& b, Double8 value) {
    for (int i = 0; i < PARTS; ++i) value.part[i] = a.part[i] >= b.part[i] ? value.part[i] : Part{};
    return value;
}
// value in the lanes whose number has this bit, else other.
VECTOR_INLINE Double8 where_bit(int bit, Double8 value, const Double8& other) {
    typedef long long Mask __attribute__((vector_size(sizeof(Part))));
    for (int i = 0; i < PARTS; ++i) {
        Mask mask{};
        for (int lane = 0; lane < LANES / PARTS; ++lane) mask[lane] = -(((i * LANES / PARTS + lane) >> bit) & 1);
        value.part[i] = mask ? value.part[i] : other.part[i];
    }
    return value;
}
using engine::flushed;
// What is below FLUSH: 0, as `flushed` of one number.
VECTOR_INLINE Double8 flushed(const Double8& value) {
    return where_at_least(value * value, broadcast(FLUSH_SQUARED), value);
}
// Sum across the lanes: ((0+4)+(2+6)) + ((1+5)+(3+7)).
VECTOR_INLINE double total(const Double8& value) {
    double lane[LANES];
    store(lane, value);
    return ((lane[0] + lane[4]) + (lane[2] + lane[6])) + ((lane[1] + lane[5]) + (lane[3] + lane[7]));
}

struct Complex8 {
    Double8 re, im;
};

VECTOR_INLINE Complex8 operator*(const Complex8& a, const Complex8& b) {
    return {a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

}  // namespace VECTOR_LEVEL
}  // namespace engine
