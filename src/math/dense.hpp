// Products of matrices, and eigenvalues of symmetric ones, of the same bits on every machine: LAPACK's and BLAS's
// follow the processor. Every sum runs in the order of its index; rows are added as wholes.
#pragma once

#include "../array.hpp"
#include "../vector_level.hpp"

namespace engine {

constexpr int64_t EIGEN_ROWS = 12;

struct Dense {
    // a (p, q), b (q, r) -> out (p, r) = a b
    void (*multiply)(Array<const double, 2> a, Array<const double, 2> b, Array<double, 2> out);
    // a (n, n) symmetric, becomes its eigenvectors by rows; value (n,) ascending; scratch (n + EIGEN_ROWS, n)
    // Householder's reflections, then implicit QL [Golub & Van Loan 2013, alg. 8.3.1, 8.3.3; EISPACK imtql2].
    // Returns whether it converged: always where all is finite.
    bool (*eigenpairs)(Array<double, 2> a, Array<double, 1> value, Array<double, 2> scratch);
};
CHOOSE_VECTOR(Dense, dense)

}  // namespace engine
