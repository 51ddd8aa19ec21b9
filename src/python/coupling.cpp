// Python's door to src/contact/coupling.
#include <cmath>

#include "../contact/coupling/coupled_modes.hpp"
#include "../contact/coupling/patch_points.hpp"
#include "../contact/coupling/touches.hpp"
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

static void check_poles(const MotionPoles& poles, const CoupledSystem& system, int64_t pairs) {
    const int64_t m = poles.omega_rad_s.size();
    check_range("modes", m, 1, system.lam.size() + 1);
    check_shape("decay_per_s", poles.decay_per_s, m);
    check_shape("turn", poles.turn, pairs);
    check_shape("motion", poles.motion, m, m);
    check_shape("shares", poles.shares, m, 3);
    check_shape("newton", poles.newton, m);
    check_shape("force", poles.force, 2, system.spring.size(), m);
    check_shape("moved", poles.moved, 2, count_partner_modes(system), m);
}

static void check_body(const BodyTables& tables, int64_t b) {
    check_range("body", b, 0, tables.bodies.size());
    const Body& body = tables.bodies[b];
    check_range("modes", body.modes, 0, body.columns + 1);
    if (body.faces == 0) return;
    check_range("face_at", body.face_at, 0, tables.faces.size() - body.faces + 1);
    check_range("node_at", body.node_at, 0, tables.nodes.size());
    check_range("shape_at", body.shape_at, 0, tables.shapes.size() + 1);
    check_range("touched_faces", body.touched_faces, 0, tables.faces.size() + 1);
    check_range("touched_face_at", body.touched_face_at, 0, tables.faces.size() - body.touched_faces + 1);
    check_range("touched_node_at", body.touched_node_at, 0, tables.nodes.size() + 1);
}

static void check_touches(int64_t b, Array<const int64_t, 1> places, Array<const int64_t, 1> begin,
                          const BodyTables& tables, const PairTables& pairs, Array<const double, 2> quaternion,
                          const TouchSides& sides, const Touches& touches) {
    const int64_t bodies = tables.bodies.size(), columns = touches.other.shape[1];
    check_body(tables, b);
    check_shape("begin", begin, places.size());
    check_shape("quaternion", quaternion, bodies, 4);
    for (const auto& [name, values] : {std::pair{"compliance_per_pa", sides.compliance_per_pa},
                                       {"poisson", sides.poisson},
                                       {"loss_factor", sides.loss_factor},
                                       {"roughness_m", sides.roughness_m}})
        check_shape(name, values, bodies);
    check_shape("slips", sides.slips, bodies);
    check_shape("turns", sides.turns, bodies, 3, 3);
    int64_t count = 0;
    for (int64_t i = 0; i < places.size(); ++i) {
        check_range("places", places[i], 0, std::min(pairs.pair.size(), pairs.patch.size()));
        const Pair& pair = pairs.pair[places[i]];
        const int64_t other = pair.body[0] == b ? pair.body[1] : pair.body[0];
        check_range("body", b, std::min(pair.body[0], pair.body[1]), std::max(pair.body[0], pair.body[1]) + 1);
        check_range("body", (pair.body[0] == b) + (pair.body[1] == b), 1, 2);
        check_body(tables, other);
        check_range("begin", begin[i], 0, columns - (tables.bodies[other].modes + 6) + 1);
        check_range("count", pairs.patch[places[i]].count, 0, POINTS + 1);
        count += pairs.patch[places[i]].count;
    }
    check_shape("own", touches.own, 3 * count, tables.bodies[b].modes + 6);
    check_shape("other", touches.other, 3 * count, columns);
    check_shape("spring", touches.spring, 3 * count);
    check_shape("load_n", touches.load_n, count);
}

void bind_coupling(nb::module_& m) {
    m.attr("STOPPED_RATIO") = STOPPED_RATIO;
    m.attr("STIFFEST_RATIO") = STIFFEST_RATIO;
    m.def(
        "assign_columns",
        [](Array<const double, 2> weight, Integers column) {
            check_shape("column", column, weight.shape[0]);
            check_range("rows", weight.shape[0], 0, weight.shape[1] + 1);
            for (int64_t i = 0; i < weight.shape[0] * weight.shape[1]; ++i)
                if (!std::isfinite(weight.data[i])) throw nb::value_error("a weight that is not finite");
            nb::gil_scoped_release released;
            AssignmentWork work;
            assign_columns(weight, column, work);
        },
        "weight"_a, "column"_a,
        "Assign to each row of weights (m, n), m <= n, a column (m,), each once, with the largest sum.");
    m.def(
        "choose_motions",
        [](Array<const double, 2> vector, Array<const int64_t, 1> pairs, Integers chosen) {
            check_range("modes", chosen.size(), 0, std::min(vector.shape[0], vector.shape[1]) + 1);
            check_pairs(pairs, chosen.size());
            nb::gil_scoped_release released;
            std::vector<double> part(vector.shape[1]);
            choose_motions(vector, pairs, chosen, {part.data(), {vector.shape[1]}});
        },
        "vector"_a, "pairs"_a, "chosen"_a,
        "Choose for each mode the column (m,) of vector with most of it, of a pair the two with most of both; -1\n"
        "for the first where two choose the same.");
    m.def(
        "couple_modes",
        [](const CoupledSystem& system, Array<const int64_t, 1> direction, Array<const int64_t, 1> pairs,
           Array<const Turn, 1> before, const MotionPoles& poles, Array<double, 2> force_n_s) {
            check_system(system);
            check_range("springs", system.spring.size(), 1, INT64_MAX);
            check_poles(poles, system, pairs.size());
            const int64_t modes = poles.omega_rad_s.size(), touches = force_n_s.shape[0];
            check_pairs(pairs, modes);
            check_shape("direction", direction, system.spring.size());
            check_shape("force_n_s", force_n_s, touches, modes);
            for (int64_t c = 0; c < direction.size(); ++c) check_range("direction", direction[c], 0, 3 * touches);
            nb::gil_scoped_release released;
            CoupledWork work;
            return couple_modes(system, direction, pairs, before, poles, force_n_s, work);
        },
        "system"_a, "direction"_a, "pairs"_a, "before"_a, "poles"_a, "force_n_s"_a,
        "Compute the poles of a body's modes at springs, and the normal force at its touches (c, m); False where a\n"
        "number is not finite.");
    m.def(
        "fill_touches",
        [](int64_t b, Array<const int64_t, 1> places, Array<const int64_t, 1> begin, const BodyTables& tables,
           const PairTables& pairs, Array<const double, 2> quaternion, const TouchSides& sides,
           const Touches& touches) {
            check_touches(b, places, begin, tables, pairs, quaternion, sides, touches);
            nb::gil_scoped_release released;
            fill_touches(b, places, begin, tables, pairs, quaternion, sides, touches);
        },
        "b"_a, "places"_a, "begin"_a, "tables"_a, "pairs"_a, "quaternion"_a, "sides"_a, "touches"_a,
        "Fill the touches of body b, of its pairs in these places (k,); the partner's columns of other are those\n"
        "from begin (k,) on.");
}

}  // namespace engine
