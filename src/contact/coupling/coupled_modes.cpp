#include "coupled_modes.hpp"

#include <algorithm>
#include <cmath>

#include "../../math/dense.hpp"
#include "motion_poles_vector.hpp"

namespace engine {

namespace {

// Choose a motion for each mode where two have most of the same one: the assignment of the largest sum. The two of a
// pair count as one.
void assign_motions(Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen, CoupledWork& work) {
    const int64_t m = chosen.size(), n = vector.shape[1];
    work.fraction.resize(m * n);
    const Array<double, 2> fraction{work.fraction.data(), {m, n}};
    for (int64_t i = 0; i < m * n; ++i) work.fraction[i] = vector.data[i] * vector.data[i];
    for (int64_t i = 0; i < pairs.size(); ++i)
        for (int64_t k = 0; k < n; ++k) {
            double &one = fraction(pairs[i], k), &other = fraction(pairs[i] + 1, k);
            one = other = 0.5 * (one + other);
        }
    assign_columns(fraction, chosen, work.assignment);
}

// Compute the amplitude of the normal force at each touch (c, m) of the new modes: |F Qᵀ|.
void sum_forces(Array<const int64_t, 1> direction, const MotionPoles& poles, Array<double, 2> force_n_s,
                std::vector<double>& row) {
    const int64_t m = poles.omega_rad_s.size();
    row.resize(m);
    set_zero(force_n_s.data, force_n_s.shape[0] * m);
    for (int64_t c = 0; c < direction.size(); ++c) {
        if (direction[c] % 3 != 0) continue;
        double* out = force_n_s[direction[c] / 3].data;
        motion_loops().combine({poles.force[0][c].data, 1, 0}, 1, m, poles.motion.data, m, out);
        motion_loops().combine({poles.force[1][c].data, 1, 0}, 1, m, poles.motion.data, m, row.data());
        for (int64_t k = 0; k < m; ++k) out[k] = std::sqrt(out[k] * out[k] + row[k] * row[k]);
    }
}

}  // namespace

bool couple_modes(const CoupledSystem& system, Array<const int64_t, 1> direction, Array<const int64_t, 1> pairs,
                  Array<const Turn, 1> before, const MotionPoles& poles, Array<double, 2> force_n_s,
                  CoupledWork& work) {
    const int64_t m = poles.omega_rad_s.size(), r = system.spring.size();
    const int64_t n = count_motions(system);
    work.both.resize(r * n), work.stiffness.resize(n * n), work.vector.resize(n * n), work.value.resize(n);
    work.eigen.resize((n + EIGEN_ROWS) * n), work.row.resize(std::max(n * r, n)), work.chosen.resize(m);
    const Array<double, 2> both{work.both.data(), {r, n}}, stiffness{work.stiffness.data(), {n, n}};
    const Array<double, 2> vector{work.vector.data(), {n, n}};
    const Doubles value{work.value.data(), {n}};
    const Integers chosen{work.chosen.data(), {m}};
    couple_springs(system, both, stiffness, {work.row.data(), {r * n}});
    if (!std::all_of(work.stiffness.begin(), work.stiffness.end(), [](double x) { return std::isfinite(x); }))
        return false;
    if (!dense().eigenpairs(stiffness, value, {work.eigen.data(), {n + EIGEN_ROWS, n}})) return false;
    for (int64_t i = 0; i < n; ++i)
        for (int64_t k = 0; k < n; ++k) vector(i, k) = stiffness(k, i);
    choose_motions(vector, pairs, chosen, {work.row.data(), {n}});
    if (chosen[0] < 0) assign_motions(vector, pairs, chosen, work);
    solve_motions(system, {value, vector, both, chosen, pairs, before}, poles, work.motions);
    sum_forces(direction, poles, force_n_s, work.row);
    return true;
}

}  // namespace engine
