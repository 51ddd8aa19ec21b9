// Python's door to src/contact/coupling.
#include "../contact/coupling/motion_poles.hpp"
#include "../contact/coupling/patch_points.hpp"
#include "arrays.hpp"

namespace engine {

static void check_system(const CoupledSystem& system) {
    const int64_t r = system.spring.size(), own = system.lam.size(), other = system.other_lam.size();
    check_shape("own", system.own, r, own);
    check_shape("other", system.other, r, other);
    check_shape("decay", system.decay, own);
    check_shape("other_decay", system.other_decay, other);
    check_shape("plate", system.plate, r);
    check_shape("half_space", system.half_space, r);
}

static void check_pairs(Array<const int64_t, 1> pairs, int64_t modes) {
    for (int64_t i = 0; i < pairs.size(); ++i) check_range("pairs", pairs[i], 0, modes - 1);
}

static void check_motions(const Motions& motions, const CoupledSystem& system) {
    const int64_t n = motions.value.size(), m = motions.chosen.size();
    check_shape("vector", motions.vector, n, n);
    check_shape("both", motions.both, system.spring.size(), n);
    check_range("modes", m, 0, std::min(n, system.lam.size()) + 1);
    for (int64_t i = 0; i < m; ++i) check_range("chosen", motions.chosen[i], 0, n);
    check_pairs(motions.pairs, m);
    if (motions.before.size()) check_shape("before", motions.before, m, m);
}

static void check_poles(const MotionPoles& poles, const CoupledSystem& system, int64_t m) {
    check_shape("omega_rad_s", poles.omega_rad_s, m);
    check_shape("decay_per_s", poles.decay_per_s, m);
    check_shape("turn", poles.turn, m, m);
    check_shape("motion", poles.motion, m, m);
    check_shape("shares", poles.shares, m, 3);
    check_shape("newton", poles.newton, m);
    check_shape("force", poles.force, 2, system.spring.size(), m);
    check_shape("moved", poles.moved, count_partner_modes(system), m);
}

static void check_body(const BodyTables& tables, int64_t b) {
    check_range("body", b, 0, tables.bodies.size());
    const Body& body = tables.bodies[b];
    check_range("modes", body.modes, 0, body.columns + 1);
    if (body.faces == 0) return;
    check_range("face_at", body.face_at, 0, tables.faces.size() - body.faces + 1);
    check_range("node_at", body.node_at, 0, tables.nodes.size());
    check_range("shape_at", body.shape_at, 0, tables.shapes.size() + 1);
}

void bind_coupling(nb::module_& m) {
    m.attr("STOPPED_RATIO") = STOPPED_RATIO;
    m.attr("STIFFEST_RATIO") = STIFFEST_RATIO;
    m.def(
        "count_motions",
        [](const CoupledSystem& system) {
            check_system(system);
            return count_motions(system);
        },
        "system"_a, "Count the motions of a body and of its light partners that springs couple.");
    m.def(
        "count_partner_modes", [](const CoupledSystem& system) { return count_partner_modes(system); }, "system"_a,
        "Count the partners' modes: motions of theirs that are not rigid.");
    m.def(
        "couple_springs",
        [](const CoupledSystem& system, Array<double, 2> both, Array<double, 2> stiffness) {
            check_system(system);
            const int64_t n = count_motions(system);
            check_shape("both", both, system.spring.size(), n);
            check_shape("stiffness", stiffness, n, n);
            nb::gil_scoped_release released;
            couple_springs(system, both, stiffness);
        },
        "system"_a, "both"_a, "stiffness"_a,
        "Compute both (r, n), motion at the springs of the body and of light partners' rigid motions, and their\n"
        "stiffness (n, n).");
    m.def(
        "choose_motions",
        [](Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen) {
            check_range("modes", chosen.size(), 0, std::min(vector.shape[0], vector.shape[1]) + 1);
            check_pairs(pairs, chosen.size());
            nb::gil_scoped_release released;
            choose_motions(vector, pairs, chosen);
        },
        "vector"_a, "pairs"_a, "chosen"_a,
        "Choose for each mode the column (m,) of vector with most of it, of a pair the two with most of both; -1\n"
        "for the first where two choose the same.");
    m.def(
        "solve_motions",
        [](const CoupledSystem& system, const Motions& motions, const MotionPoles& poles) {
            check_system(system);
            check_motions(motions, system);
            check_poles(poles, system, motions.chosen.size());
            nb::gil_scoped_release released;
            solve_motions(system, motions, poles);
        },
        "system"_a, "motions"_a, "poles"_a, "Compute the poles of the motions chosen.");
    m.def(
        "place_points",
        [](const BodyTables& tables, Array<const double, 2> quaternion, Array<const ContactPatch, 1> patch,
           Array<const int64_t, 1> both, Array<const double, 3> turn, Array<double, 3> lower, Array<double, 3> higher,
           Doubles curvature_per_m) {
            check_shape("patch", patch, 1);
            check_shape("both", both, 2);
            check_shape("turn", turn, 2, 3, 3);
            check_shape("quaternion", quaternion, quaternion.shape[0], 4);
            check_range("count", patch[0].count, 0, 5);
            check_shape("curvature_per_m", curvature_per_m, patch[0].count);
            const Array<double, 3> moves[2] = {lower, higher};
            const int64_t bodies[2] = {both[0], both[1]};
            for (int side = 0; side < 2; ++side) {
                check_body(tables, bodies[side]);
                check_range("body", bodies[side], 0, quaternion.shape[0]);
                check_shape("moves", moves[side], patch[0].count, 3, tables.bodies[bodies[side]].modes + 6);
            }
            nb::gil_scoped_release released;
            return place_points(tables, quaternion, patch[0], bodies, turn, moves, curvature_per_m);
        },
        "tables"_a, "quaternion"_a, "patch"_a, "both"_a, "turn"_a, "lower"_a, "higher"_a, "curvature_per_m"_a,
        "Fill the motion of both bodies at a patch's points, (points, 3, modes + 6) of zeros each, and\n"
        "curvature_per_m (points,) of zeros; return the distance of their middle from the farther surface.");
}

}  // namespace engine
