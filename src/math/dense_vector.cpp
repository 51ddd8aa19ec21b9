#include <algorithm>
#include <cmath>
#include <utility>

#include "dense.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

void add_row(double factor, const double* __restrict from, double* __restrict to, int64_t n) {
    for (int64_t i = 0; i < n; ++i) to[i] += factor * from[i];
}

double dot(const double* a, const double* b, int64_t n) {
    double sum = 0.0;
    for (int64_t i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
}

void multiply(Array<const double, 2> a, Array<const double, 2> b, Array<double, 2> out) {
    const int64_t columns = b.shape[1];
    for (int64_t i = 0; i < a.shape[0]; ++i) {
        double* row = out[i].data;
        std::fill(row, row + columns, 0.0);
        for (int64_t j = 0; j < a.shape[1]; ++j) add_row(a(i, j), b[j].data, row, columns);
    }
}

// a (n, n) -> tridiagonal: diagonal (n,), below (n,), its last 0; a's row k keeps the reflection v of step k from
// column k + 1 on, factor (n,) its 2/v·v.
void tridiagonalise(Array<double, 2> a, double* diagonal, double* below, double* factor, double* product) {
    const int64_t n = a.shape[0];
    for (int64_t k = 0; k + 1 < n; ++k) {
        const int64_t first = k + 1, count = n - first;
        double* v = &a(k, first);
        diagonal[k] = a(k, k);
        const double rest = count > 1 ? dot(v + 1, v + 1, count - 1) : 0.0;
        factor[k] = 0.0;
        below[k] = v[0];
        if (rest == 0.0) continue;
        const double size = std::sqrt(v[0] * v[0] + rest);
        below[k] = v[0] > 0.0 ? -size : size;
        v[0] -= below[k];
        factor[k] = 2.0 / (v[0] * v[0] + rest);
        std::fill(product, product + count, 0.0);
        for (int64_t i = 0; i < count; ++i) add_row(factor[k] * v[i], &a(first + i, first), product, count);
        add_row(-0.5 * factor[k] * dot(v, product, count), v, product, count);
        for (int64_t i = 0; i < count; ++i) {
            double* __restrict row = &a(first + i, first);
            const double own = v[i], moved = product[i];
            for (int64_t j = 0; j < count; ++j) row[j] -= own * product[j] + moved * v[j];
        }
    }
    diagonal[n - 1] = a(n - 1, n - 1);
    below[n - 1] = factor[n - 1] = 0.0;
}

// The product of all reflections, by columns: a's rows hold them -> turn (n, n).
void join_reflections(Array<const double, 2> a, const double* factor, double* sum, Array<double, 2> turn) {
    const int64_t n = a.shape[0];
    std::fill(turn.data, turn.data + n * n, 0.0);
    for (int64_t i = 0; i < n; ++i) turn(i, i) = 1.0;
    for (int64_t k = n - 2; k >= 0; --k) {
        if (factor[k] == 0.0) continue;
        const int64_t first = k + 1, count = n - first;
        const double* v = &a(k, first);
        std::fill(sum, sum + count, 0.0);
        for (int64_t i = 0; i < count; ++i) add_row(v[i], &turn(first + i, first), sum, count);
        for (int64_t i = 0; i < count; ++i) add_row(-factor[k] * v[i], sum, &turn(first + i, first), count);
    }
}

void rotate_rows(double cosine, double sine, double* __restrict one, double* __restrict other, int64_t n) {
    for (int64_t i = 0; i < n; ++i) {
        const double before = one[i], after = other[i];
        other[i] = sine * before + cosine * after;
        one[i] = cosine * before - sine * after;
    }
}

// Diagonal and below of a tridiagonal matrix -> eigenvalues in diagonal; rows (n, n) turn along.
bool solve_tridiagonal(double* diagonal, double* below, Array<double, 2> rows) {
    const int64_t n = rows.shape[0];
    constexpr double LAST_BIT = 2.220446049250313e-16;
    constexpr int MOST_TURNS = 60;  // an eigenvalue takes two or three
    for (int64_t l = 0; l < n; ++l) {
        for (int turn = 0;; ++turn) {
            int64_t m = l;
            while (m + 1 < n && std::fabs(below[m]) > LAST_BIT * (std::fabs(diagonal[m]) + std::fabs(diagonal[m + 1])))
                ++m;
            if (m == l) break;
            if (turn == MOST_TURNS) return false;
            double g = (diagonal[l + 1] - diagonal[l]) / (2.0 * below[l]);
            double r = std::sqrt(g * g + 1.0);
            g = diagonal[m] - diagonal[l] + below[l] / (g + (g < 0.0 ? -r : r));
            double sine = 1.0, cosine = 1.0, shift = 0.0;
            int64_t i = m - 1;
            for (; i >= l; --i) {
                const double f = sine * below[i], b = cosine * below[i];
                r = std::sqrt(f * f + g * g);
                below[i + 1] = r;
                if (r == 0.0) {  // it falls in two
                    diagonal[i + 1] -= shift;
                    below[m] = 0.0;
                    break;
                }
                sine = f / r, cosine = g / r;
                g = diagonal[i + 1] - shift;
                r = (diagonal[i] - g) * sine + 2.0 * cosine * b;
                shift = sine * r;
                diagonal[i + 1] = g + shift;
                g = cosine * r - b;
                rotate_rows(cosine, sine, rows[i].data, rows[i + 1].data, n);
            }
            if (i >= l) continue;
            diagonal[l] -= shift;
            below[l] = g;
            below[m] = 0.0;
        }
    }
    return true;
}

bool eigenpairs(Array<double, 2> a, Array<double, 1> value, Array<double, 2> scratch) {
    const int64_t n = a.shape[0];
    if (n == 0) return true;
    double *diagonal = value.data, *below = scratch[0].data, *factor = scratch[1].data, *row = scratch[2].data;
    Array<double, 2> turn{scratch.data + 3 * n, {n, n}};
    tridiagonalise(a, diagonal, below, factor, row);
    join_reflections(a, factor, row, turn);
    for (int64_t i = 0; i < n; ++i)
        for (int64_t j = 0; j < n; ++j) a(i, j) = turn(j, i);
    if (!solve_tridiagonal(diagonal, below, a)) return false;
    for (int64_t i = 0; i + 1 < n; ++i) {  // ascending
        int64_t least = i;
        for (int64_t j = i + 1; j < n; ++j)
            if (diagonal[j] < diagonal[least]) least = j;
        if (least == i) continue;
        std::swap(diagonal[i], diagonal[least]);
        std::swap_ranges(a[i].data, a[i].data + n, a[least].data);
    }
    return true;
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Dense, dense) = {VECTOR_LEVEL::multiply, VECTOR_LEVEL::eigenpairs};

}  // namespace engine
