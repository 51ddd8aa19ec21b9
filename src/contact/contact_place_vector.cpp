#include "contact_place_vector.hpp"

#include "../vector8.hpp"
#include "../vector_level.hpp"

namespace engine {
namespace VECTOR_LEVEL {

typedef float FloatPart __attribute__((vector_size(4 * LANES / PARTS)));

static VECTOR_INLINE Double8 load_floats(const float* from) {
    FloatPart narrow[PARTS];
    std::memcpy(narrow, from, sizeof narrow);
    Double8 out;
    for (int i = 0; i < PARTS; ++i) out.part[i] = __builtin_convertvector(narrow[i], Part);
    return out;
}

static void add_shape(const float* shape, int64_t columns, const double* factor, double* out) {
    const float *x = shape, *y = shape + columns, *z = shape + 2 * columns;
    const Double8 along_x = broadcast(factor[0]), along_y = broadcast(factor[1]), along_z = broadcast(factor[2]);
    int64_t c = 0;
    for (; c + LANES <= columns; c += LANES)
        store(out + c, load(out + c) + along_x * load_floats(x + c) + along_y * load_floats(y + c) +
                           along_z * load_floats(z + c));
    for (; c < columns; ++c) out[c] = out[c] + factor[0] * x[c] + factor[1] * y[c] + factor[2] * z[c];
}

}  // namespace VECTOR_LEVEL

VECTOR_TABLE(PlaceVector, place_vector) = {VECTOR_LEVEL::add_shape};

}  // namespace engine
