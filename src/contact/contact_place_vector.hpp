// Loops over modes of contact_place, eight at once.
#pragma once

#include <cstdint>

#include "../vector_level.hpp"

namespace engine {

struct PlaceVector {
    // Add factor (3,) times the shapes of a vertex, (3, columns), to out (columns,).
    void (*add_shape)(const float* shape, std::int64_t columns, const double* factor, double* out);
};
CHOOSE_VECTOR(PlaceVector, place_vector)

}  // namespace engine
