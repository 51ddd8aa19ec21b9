#include <algorithm>
#include <cmath>
#include <utility>

#include "../vector8.hpp"
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

// Row ← row − (a x + b y), then sum += f row, of so many numbers of each row; rows follow each other after ``stride``.
template <int ROWS>
void update_rows(double* __restrict rows, int64_t stride, const double* a, const double* __restrict x, const double* b,
                 const double* __restrict y, const double (&f)[ROWS], double* __restrict sum, int64_t n) {
    for (int64_t j = 0; j < n; ++j) {
        double total = sum[j];
#pragma GCC unroll 4
        for (int r = 0; r < ROWS; ++r) {
            const double now = rows[r * stride + j] - (a[r] * x[j] + b[r] * y[j]);
            rows[r * stride + j] = now;
            total += f[r] * now;
        }
        sum[j] = total;
    }
}

// Row ← row + a x, then sum += f row.
template <int ROWS>
void reflect_rows(double* __restrict rows, int64_t stride, const double (&a)[ROWS], const double* __restrict x,
                  const double* f, double* __restrict sum, int64_t n) {
    for (int64_t j = 0; j < n; ++j) {
        double total = sum[j];
#pragma GCC unroll 4
        for (int r = 0; r < ROWS; ++r) {
            const double now = rows[r * stride + j] + a[r] * x[j];
            rows[r * stride + j] = now;
            total += f[r] * now;
        }
        sum[j] = total;
    }
}

// A tridiagonal matrix and the reflections that lead to it: diagonal (n,), below (n,), its last 0; factor (n,) 2/v·v of
// each reflection's v, which a's row k keeps from column k + 1 on; 0 where there is none.
struct Tridiagonal {
    double *diagonal, *below, *factor;
};

// Begin step k: its diagonal, what is below it, and v. False where the row is tridiagonal as it is.
bool begin_reflection(int64_t k, Array<double, 2> a, const Tridiagonal& t) {
    const int64_t count = a.shape[0] - k - 1;
    double* v = &a(k, k + 1);
    t.diagonal[k] = a(k, k), t.below[k] = v[0], t.factor[k] = 0.0;
    const double rest = count > 1 ? dot(v + 1, v + 1, count - 1) : 0.0;
    if (rest == 0.0) return false;
    const double size = std::sqrt(v[0] * v[0] + rest);
    t.below[k] = v[0] > 0.0 ? -size : size;
    v[0] -= t.below[k];
    t.factor[k] = 2.0 / (v[0] * v[0] + rest);
    return true;
}

// Reflect a (n, n) to tridiagonal form. One pass over what is left applies a step's reflection and multiplies by the
// next one's v. product, next (n,): scratch.
void tridiagonalise(Array<double, 2> a, const Tridiagonal& t, double* product, double* next) {
    const int64_t n = a.shape[0];
    bool multiplied = false;  // product is a v_k times its factor
    for (int64_t k = 0; k + 1 < n; ++k) {
        const int64_t first = k + 1, count = n - first;
        double* v = &a(k, first);
        if (!multiplied) {
            if (!begin_reflection(k, a, t)) continue;
            std::fill(product, product + count, 0.0);
            for (int64_t i = 0; i < count; ++i) add_row(t.factor[k] * v[i], &a(first + i, first), product, count);
        }
        add_row(-0.5 * t.factor[k] * dot(v, product, count), v, product, count);
        std::fill(next, next + count, 0.0);
        const double none[1] = {0.0};
        update_rows<1>(&a(first, first), n, v, product, product, v, none, next, count);
        multiplied = begin_reflection(first, a, t);  // count > 1: else there was none at k
        std::fill(next, next + count, 0.0);
        const double *w = &a(first, first) + 1, along = t.factor[first];
        int64_t i = 1;
        for (; i + 4 <= count; i += 4) {
            const double f[4] = {along * w[i - 1], along * w[i], along * w[i + 1], along * w[i + 2]};
            update_rows<4>(&a(first + i, first) + 1, n, v + i, product + 1, product + i, v + 1, f, next, count - 1);
        }
        for (; i < count; ++i) {
            const double f[1] = {along * w[i - 1]};
            update_rows<1>(&a(first + i, first) + 1, n, v + i, product + 1, product + i, v + 1, f, next, count - 1);
        }
        std::swap(product, next);
    }
    t.diagonal[n - 1] = a(n - 1, n - 1);
    t.below[n - 1] = t.factor[n - 1] = 0.0;
}

// The product of all reflections, by columns: a's rows hold them -> turn (n, n). One pass over the rows applies a
// reflection and multiplies them by the next one's v. sum, next (n,): scratch.
void join_reflections(Array<const double, 2> a, const double* factor, double* sum, double* next,
                      Array<double, 2> turn) {
    const int64_t n = a.shape[0];
    std::fill(turn.data, turn.data + n * n, 0.0);
    for (int64_t i = 0; i < n; ++i) turn(i, i) = 1.0;
    bool multiplied = false;  // sum is v_k times the rows
    for (int64_t k = n - 2; k >= 0; --k) {
        if (factor[k] == 0.0) {
            multiplied = false;
            continue;
        }
        const int64_t first = k + 1, count = n - first;
        const double* v = &a(k, first);
        if (!multiplied) {
            std::fill(sum, sum + count, 0.0);
            for (int64_t i = 0; i < count; ++i) add_row(v[i], &turn(first + i, first), sum, count);
        }
        multiplied = k > 0 && factor[k - 1] != 0.0;
        const double* w = multiplied ? &a(k - 1, first) : v;  // of row first + i: w[i]; row k is its unit vector yet
        std::fill(next, next + count + 1, 0.0);
        if (multiplied) next[0] = a(k - 1, k);
        int64_t i = 0;
        for (; i + 4 <= count; i += 4) {
            const double by[4] = {-factor[k] * v[i], -factor[k] * v[i + 1], -factor[k] * v[i + 2],
                                  -factor[k] * v[i + 3]};
            reflect_rows<4>(&turn(first + i, first), n, by, sum, w + i, next + 1, count);
        }
        for (; i < count; ++i) {
            const double by[1] = {-factor[k] * v[i]};
            reflect_rows<1>(&turn(first + i, first), n, by, sum, w + i, next + 1, count);
        }
        std::swap(sum, next);
    }
}

// A sweep of rotations of rows i and i + 1, i from last down to first.
struct Sweep {
    int64_t first, last;
    const double *cosine, *sine;  // of i
};

// Rotate 8·EIGHTS columns of rows ``stride`` apart; what passes from row to row stays in registers.
template <int EIGHTS>
VECTOR_INLINE void rotate_columns(const Sweep& sweep, double* column, int64_t stride) {
    Double8 carried[EIGHTS];
    for (int e = 0; e < EIGHTS; ++e) carried[e] = load(column + (sweep.last + 1) * stride + e * LANES);
    for (int64_t i = sweep.last; i >= sweep.first; --i) {
        const Double8 cosine = broadcast(sweep.cosine[i]), sine = broadcast(sweep.sine[i]);
        double* row = column + i * stride;
#pragma GCC unroll 4
        for (int e = 0; e < EIGHTS; ++e) {
            const Double8 before = load(row + e * LANES);
            store(row + stride + e * LANES, sine * before + cosine * carried[e]);
            carried[e] = cosine * before - sine * carried[e];
        }
    }
    for (int e = 0; e < EIGHTS; ++e) store(column + sweep.first * stride + e * LANES, carried[e]);
}

// Rows (n, n): whole eights of their columns in place, what is left over in edge (n, 8).
struct TurnedRows {
    double* rows;
    double* edge;
    int64_t n;

    int64_t whole() const { return n - n % LANES; }
    void rotate(const Sweep& sweep) const {
        int64_t k = 0;
        for (; k + 2 * LANES <= n; k += 2 * LANES) rotate_columns<2>(sweep, rows + k, n);
        if (k + LANES <= n) rotate_columns<1>(sweep, rows + k, n);
        if (whole() < n) rotate_columns<1>(sweep, edge, LANES);
    }
    void take_edge() const {
        for (int64_t i = 0; i < n; ++i)
            for (int64_t j = 0; j < LANES; ++j) edge[i * LANES + j] = whole() + j < n ? rows[i * n + whole() + j] : 0.0;
    }
    void put_edge() const {
        for (int64_t i = 0; i < n; ++i)
            for (int64_t j = whole(); j < n; ++j) rows[i * n + j] = edge[i * LANES + j - whole()];
    }
};

// Diagonal and below of a tridiagonal matrix -> eigenvalues in diagonal; rows turn along. cosines, sines (n,): scratch.
// What couples two eigenvalues counts as 0 by their own size at first, so that small ones are exact where they can be.
// Of many that are 0 but for rounding, what is left is noise of the matrix's size: by that it is judged then [tql2].
bool solve_tridiagonal(double* diagonal, double* below, const TurnedRows& rows, double* cosines, double* sines) {
    const int64_t n = rows.n;
    constexpr double LAST_BIT = 2.220446049250313e-16;
    constexpr int MOST_TURNS = 60, USUAL_TURNS = 8;  // an eigenvalue takes two or three
    double largest = 0.0;
    for (int64_t i = 0; i < n; ++i)
        largest = std::max(largest, std::fabs(diagonal[i]) + (i + 1 < n ? std::fabs(below[i]) : 0.0));
    for (int64_t l = 0; l < n; ++l) {
        for (int turn = 0;; ++turn) {
            const double least = turn < USUAL_TURNS ? 0.0 : largest;
            const auto size = [&](int64_t i) {
                return std::max(least, std::fabs(diagonal[i]) + std::fabs(diagonal[i + 1]));
            };
            int64_t m = l;
            while (m + 1 < n && std::fabs(below[m]) > LAST_BIT * size(m)) ++m;
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
                cosines[i] = cosine, sines[i] = sine;
            }
            if (i + 1 < m) rows.rotate({i + 1, m - 1, cosines, sines});
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
    double* diagonal = value.data;
    double *below = scratch[0].data, *factor = scratch[1].data, *one = scratch[2].data, *other = scratch[3].data;
    Array<double, 2> turn{scratch.data + 12 * n, {n, n}};
    tridiagonalise(a, {diagonal, below, factor}, one, other);
    join_reflections(a, factor, one, other, turn);
    for (int64_t i = 0; i < n; ++i)
        for (int64_t j = 0; j < n; ++j) a(i, j) = turn(j, i);
    const TurnedRows rows{a.data, scratch[4].data, n};
    rows.take_edge();
    if (!solve_tridiagonal(diagonal, below, rows, one, other)) return false;
    rows.put_edge();
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
