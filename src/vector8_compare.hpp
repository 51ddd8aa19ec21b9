// Comparisons, choices, bits and roots of eight doubles, lane by lane: beside vector8.hpp, for NAME_vector.cpp alone.
#pragma once

#include <cmath>
#include <cstdint>

#include "vector8.hpp"
#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace engine::VECTOR_LEVEL {

typedef std::int64_t PartBits __attribute__((vector_size(8 * LANES / PARTS)));

// A lane's condition, all ones or zeros; or its number's bits.
struct Bits8 {
    PartBits part[PARTS];
};

VECTOR_INLINE Bits8 bits_of(const Double8& value) {
    Bits8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = reinterpret_cast<PartBits>(value.part[i]);
    return out;
}
VECTOR_INLINE Bits8 operator|(Bits8 a, const Bits8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] |= b.part[i];
    return a;
}
VECTOR_INLINE Bits8 operator&(Bits8 a, const Bits8& b) {
    for (int i = 0; i < PARTS; ++i) a.part[i] &= b.part[i];
    return a;
}
VECTOR_INLINE Bits8 operator<(const Double8& a, const Double8& b) {
    Bits8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = a.part[i] < b.part[i];
    return out;
}
VECTOR_INLINE Bits8 operator<=(const Double8& a, const Double8& b) {
    Bits8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = a.part[i] <= b.part[i];
    return out;
}
VECTOR_INLINE Bits8 operator==(const Double8& a, const Double8& b) {
    Bits8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = a.part[i] == b.part[i];
    return out;
}
// In each lane a where the condition holds, else b.
VECTOR_INLINE Double8 choose(const Bits8& condition, const Double8& a, const Double8& b) {
    Double8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = condition.part[i] ? a.part[i] : b.part[i];
    return out;
}
// One bit a lane, set where the condition holds.
VECTOR_INLINE unsigned lane_bits(const Bits8& condition) {
    unsigned out = 0;
    for (int i = 0; i < PARTS; ++i) {
#if defined(__AVX512F__)
        out |= static_cast<unsigned>(_mm512_movepi64_mask(reinterpret_cast<__m512i>(condition.part[i])));
#elif defined(__AVX__)
        out |= static_cast<unsigned>(_mm256_movemask_pd(reinterpret_cast<__m256d>(condition.part[i]))) << (4 * i);
#elif defined(__x86_64__)
        out |= static_cast<unsigned>(_mm_movemask_pd(reinterpret_cast<__m128d>(condition.part[i]))) << (2 * i);
#else
        for (int lane = 0; lane < LANES / PARTS; ++lane)
            out |= static_cast<unsigned>(condition.part[i][lane] & 1) << (LANES / PARTS * i + lane);
#endif
    }
    return out;
}
VECTOR_INLINE bool all_lanes(const Bits8& condition) {
    return lane_bits(condition) == (1u << LANES) - 1;
}
VECTOR_INLINE double first_lane(const Double8& value) {
    return value.part[0][0];
}
VECTOR_INLINE Double8 root(Double8 value) {
    for (int i = 0; i < PARTS; ++i) {
#if defined(__AVX512F__)
        value.part[i] = _mm512_maskz_sqrt_pd(0xff, value.part[i]);
#elif defined(__AVX__)
        value.part[i] = _mm256_sqrt_pd(value.part[i]);
#elif defined(__x86_64__)
        value.part[i] = _mm_sqrt_pd(value.part[i]);
#else
        for (int lane = 0; lane < LANES / PARTS; ++lane) value.part[i][lane] = std::sqrt(value.part[i][lane]);
#endif
    }
    return value;
}

}  // namespace engine::VECTOR_LEVEL
