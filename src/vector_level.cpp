#include "vector_level.hpp"

#if defined(__x86_64__)
#include <cpuid.h>
#endif

namespace engine {

namespace {

#if defined(__x86_64__)
// What the processor has and the system saves [Intel 64 Architectures Software Developer's Manual, vol. 1, sec. 13.3,
// 14.3 and 15.2]. __builtin_cpu_supports asks for a symbol of the compiler's library, which clang's does not let a
// shared module have.
VectorLevel best_of_processor() {
    constexpr unsigned os_saves = 1u << 27, avx2 = 1u << 5;
    constexpr unsigned avx512 = 1u << 16 | 1u << 17 | 1u << 31;  // F, DQ, VL
    constexpr unsigned wide = 0x6, widest = wide | 0xe0;         // registers that are saved: of AVX, of AVX-512
    unsigned a = 0, b = 0, c = 0, d = 0, saved = 0, saved_high = 0;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & os_saves)) return VectorLevel::baseline;
    __asm__("xgetbv" : "=a"(saved), "=d"(saved_high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return VectorLevel::baseline;
    if ((saved & widest) == widest && (b & avx512) == avx512) return VectorLevel::avx512;
    return (saved & wide) == wide && (b & avx2) ? VectorLevel::avx2 : VectorLevel::baseline;
}
#else
VectorLevel best_of_processor() {
    return VectorLevel::baseline;
}
#endif

VectorLevel level_in_use = best_of_processor();

}  // namespace

VectorLevel best_vector_level() {
    return best_of_processor();
}

VectorLevel vector_level() {
    return level_in_use;
}

void force_vector_level(VectorLevel level) {
    level_in_use = level;
}

}  // namespace engine
