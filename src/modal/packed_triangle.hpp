// Triangles of a sparse Cholesky factor, as children leave them to their parents [Liu 1992, ch. 2-4]: the rows of an
// upper triangle, one after the other.
#pragma once

#include "../array.hpp"

namespace engine {

// Pack the upper triangle of a matrix (c, c): c (c + 1)/2 numbers.
void pack_triangle(Array<const double, 2> matrix, Doubles packed);

// Add a child's packed triangle of c rows to its parent, at the ascending places (c,) among the parent's columns:
// column (w, n) are its own, rest (n − w, n − w) what it leaves in turn; both transposed.
void add_triangle(Array<const double, 1> packed, Array<const int64_t, 1> place, Array<double, 2> column,
                  Array<double, 2> rest);

}  // namespace engine
