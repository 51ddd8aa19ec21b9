#include "vector_level.hpp"

namespace engine {

VectorLevel best_vector_level() {
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return VectorLevel::avx512;
    if (__builtin_cpu_supports("avx2")) return VectorLevel::avx2;
#endif
    return VectorLevel::baseline;
}

static VectorLevel level_in_use = best_vector_level();

VectorLevel vector_level() {
    return level_in_use;
}

void force_vector_level(VectorLevel level) {
    level_in_use = level;
}

}  // namespace engine
