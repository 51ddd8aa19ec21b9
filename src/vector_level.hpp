// Which vector instructions this process uses: chosen once, when it starts; the bits are the same with each.
//
// A file NAME_vector.cpp is compiled once a level. It fills a table of its functions, `VECTOR_TABLE(Tile, tile) =
// {…};`, and its header names the table's type and says `CHOOSE_VECTOR(Tile, tile)`: `tile().outer(…)` calls the level
// in use.
#pragma once

namespace engine {

constexpr int LANES = 8;  // doubles at once, at every level

enum class VectorLevel { baseline, avx2, avx512 };

VectorLevel best_vector_level();             // of this processor
VectorLevel vector_level();                  // in use: the best one, unless another was forced
void force_vector_level(VectorLevel level);  // for tests, before anything runs

}  // namespace engine

#define VECTOR_JOIN2(a, b) a##_##b
#define VECTOR_JOIN(a, b) VECTOR_JOIN2(a, b)
#define VECTOR_TABLE(Table, name)                       \
    extern const Table VECTOR_JOIN(name, VECTOR_LEVEL); \
    const Table VECTOR_JOIN(name, VECTOR_LEVEL)

#if defined(__x86_64__)
#define CHOOSE_VECTOR(Table, name)                                  \
    extern const Table name##_baseline, name##_avx2, name##_avx512; \
    inline const Table& name() {                                    \
        switch (vector_level()) {                                   \
            case VectorLevel::avx512: return name##_avx512;         \
            case VectorLevel::avx2: return name##_avx2;             \
            default: return name##_baseline;                        \
        }                                                           \
    }
#else
#define CHOOSE_VECTOR(Table, name)      \
    extern const Table name##_baseline; \
    inline const Table& name() {        \
        return name##_baseline;         \
    }
#endif
