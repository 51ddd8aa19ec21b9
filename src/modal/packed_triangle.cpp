#include "packed_triangle.hpp"

#include <cstring>

namespace engine {

void pack_triangle(Array<const double, 2> matrix, Doubles packed) {
    const int64_t size = matrix.size();
    double* to = packed.data;
    for (int64_t j = 0; j < size; ++j) {
        std::memcpy(to, matrix[j].data + j, static_cast<std::size_t>(size - j) * sizeof(double));
        to += size - j;
    }
}

void add_triangle(Array<const double, 1> packed, Array<const int64_t, 1> place, Array<double, 2> column,
                  Array<double, 2> rest) {
    const int64_t width = column.size(), count = place.size();
    const double* from = packed.data;
    for (int64_t j = 0; j < count; ++j) {
        const bool own = place[j] < width;
        const Doubles to = own ? column[place[j]] : rest[place[j] - width];
        const int64_t shift = own ? 0 : width;
        for (int64_t i = j; i < count; ++i) to[place[i] - shift] += from[i - j];
        from += count - j;
    }
}

}  // namespace engine
