// Python's door to src/contact.
#include <nanobind/stl/pair.h>

#include <algorithm>
#include <vector>

#include "../contact/contact_oscillator.hpp"
#include "../contact/contact_patches.hpp"
#include "../contact/contact_place.hpp"
#include "../contact/contact_rows.hpp"
#include "../contact/friction.hpp"
#include "../contact/hertz.hpp"
#include "../contact/load_splitting.hpp"
#include "../contact/octave_heights.hpp"
#include "../contact/profile.hpp"
#include "../contact/pulse_shape.hpp"
#include "../contact/strike_cause.hpp"
#include "../contact/strike_forces.hpp"
#include "../contact/strike_timing.hpp"
#include "../contact/track.hpp"
#include "arrays.hpp"
#include "table_checks.hpp"

namespace engine {

static void check_surface(const Body& body, const BodyTables& table) {
    check_range("faces", body.faces, 0, table.faces.size() + 1);
    check_range("face_at", body.face_at, 0, table.faces.size() - body.faces + 1);
    check_range("node_at", body.node_at, 0, table.nodes.size() + 1);
    check_range("shape_at", body.shape_at, 0, table.shapes.size() + 1);
    check_range("touched_faces", body.touched_faces, 0, table.faces.size() + 1);
    check_range("touched_face_at", body.touched_face_at, 0, table.faces.size() - body.touched_faces + 1);
    check_range("touched_node_at", body.touched_node_at, 0, table.nodes.size() + 1);
    if (body.touched_faces > 0)
        check_tree(table.faces.part(body.touched_face_at, body.touched_face_at + body.touched_faces),
                   table.nodes.part(body.touched_node_at, table.nodes.size()));
    if (body.faces == 0) return;
    const Array<const Face, 1> faces = table.faces.part(body.face_at, body.face_at + body.faces);
    check_tree(faces, table.nodes.part(body.node_at, table.nodes.size()));
    if (body.columns == 0) return;
    const int64_t vertices = (table.shapes.size() - body.shape_at) / 3 / body.columns;
    for (int64_t f = 0; f < faces.size(); ++f)
        for (const int64_t vertex : faces[f].vertex) check_range("vertex", vertex, 0, vertices);
}

void check_table(const BodyTables& table) {
    for (int64_t b = 0; b < table.bodies.size(); ++b) {
        const Body& body = table.bodies[b];
        check_range("modes", body.modes, 0, INT64_MAX);
        check_range("columns", body.columns, body.modes, INT64_MAX);
        check_range("turns", body.turns, 0, table.turns.size() + 1);
        if (body.turns > 0) check_range("turn_at", body.turn_at, 0, table.turns.size() - body.turns + 1);
        for (int64_t q = 0; q < body.turns; ++q)
            check_range("mode of a turn", table.turns[body.turn_at + q].mode, 0, body.columns - 1);
        if (body.track_count > 0) {
            const int64_t slopes = table.tracks.size() / OCTAVES;
            check_range("track_count", body.track_count, 0, slopes + 1);
            check_range("track_at", body.track_at, 0, table.tracks.size() - OCTAVES * body.track_count + 1);
        }
        check_surface(body, table);
    }
}

namespace {

// A few numbers of a fixed length, as a C array.
template <int N>
struct Few {
    double number[N];
};
template <int N>
Few<N> few(const char* name, Array<const double, 1> given) {
    check_shape(name, given, N);
    Few<N> out;
    for (int i = 0; i < N; ++i) out.number[i] = given[i];
    return out;
}

Octaves& octaves(const char* name, Doubles given) {
    check_shape(name, given, OCTAVES);
    return *reinterpret_cast<Octaves*>(given.data);
}

void check_rows(Array<const ContactRow, 1> rows, int64_t bodies) {
    for (int64_t r = 0; r < rows.size(); ++r)
        for (int64_t body : rows[r].body) check_range("body of a row", body, 0, bodies);
}

// Check that the pairs' places are there, and so many more free ones.
void check_pairs(const PairTables& pairs, int64_t fresh = 0) {
    const int64_t places = pairs.pair.size();
    check_shape("count", pairs.count, 2);
    check_range("count", pairs.count[0], 0, pairs.active.size() - fresh + 1);
    check_range("count", pairs.count[1], fresh, pairs.free.size() + 1);
    for (int64_t i = 0; i < pairs.count[0]; ++i) check_range("active", pairs.active[i], 0, places);
    for (int64_t i = 0; i < pairs.count[1]; ++i) check_range("free", pairs.free[i], 0, places);
}

void check_bodies_of(const PairTables& pairs, int64_t bodies) {
    for (int64_t i = 0; i < pairs.count[0]; ++i)
        for (int64_t body : pairs.pair[pairs.active[i]].body) check_range("body of a pair", body, 0, bodies);
}

void check_window(const WindowTables& window, int64_t bodies) {
    check_shape("step", window.step, SPAN);
    check_shape("quaternion_xyzw", window.quaternion_xyzw, SPAN, bodies, 4);
    for (int64_t slot = 0; slot < SPAN; ++slot) {
        const auto& [first, stop] = window.step[slot].row;
        check_range("row", first, 0, window.row.size() + 1);
        check_range("row", stop, first, window.row.size() + 1);
        if (stop > first) check_rows(window.row.part(first, stop), bodies);
    }
}

// Check the faces of rows in which they are known already: which a caller's may be.
void check_touched(Array<const ContactRow, 1> rows, const BodyTables& table) {
    for (int64_t r = 0; r < rows.size(); ++r)
        for (int side = 0; side < 2 && rows[r].touched; ++side)
            check_range("face of a row", rows[r].face[side], -1, table.bodies[rows[r].body[side]].faces);
}

void check_window(const WindowTables& window, const BodyTables& table) {
    check_window(window, table.bodies.size());
    for (int64_t slot = 0; slot < SPAN; ++slot) {
        const auto& [first, stop] = window.step[slot].row;
        check_touched(window.row.part(first, stop), table);
    }
}

void bind_loads(nb::module_& m) {
    m.def(
        "orient",
        [](Array<const Contact, 1> contacts, Array<const double, 2> quaternion_xyzw, Array<ContactRow, 1> rows) {
            check_shape("rows", rows, contacts.size());
            check_shape("quaternion_xyzw", quaternion_xyzw, quaternion_xyzw.shape[0], 4);
            for (int64_t i = 0; i < contacts.size(); ++i) {
                check_range("a", contacts[i].a, 0, quaternion_xyzw.shape[0]);
                check_range("b", contacts[i].b, 0, quaternion_xyzw.shape[0]);
            }
            nb::gil_scoped_release released;
            ContactScratch memory;
            orient(contacts, quaternion_xyzw, rows, memory);
        },
        "contacts"_a, "quaternion_xyzw"_a, "rows"_a,
        "Turn the contacts (k,) of a step onto the lower body of each pair: rows (k,), sorted by pair, stably.");
    m.def(
        "enter_loads",
        [](Array<const ContactRow, 1> rows, int64_t start, int64_t stop, double dt_s, const PairTables& pairs) {
            check_range("start", start, 0, rows.size() + 1);
            check_range("stop", stop, start, rows.size() + 1);
            int64_t fresh = 0;
            for (int64_t r = start; r < stop; ++r) {
                bool known = r > start && rows[r].key == rows[r - 1].key;
                for (int64_t i = 0; i < pairs.count[0] && !known; ++i)
                    known = pairs.pair[pairs.active[i]].key == rows[r].key;
                fresh += !known;
            }
            check_pairs(pairs, fresh);
            nb::gil_scoped_release released;
            ContactScratch memory;
            enter_loads(rows, start, stop, dt_s, pairs, memory);
        },
        "rows"_a, "start"_a, "stop"_a, "dt_s"_a, "pairs"_a,
        "Enter the loads of rows start … stop - 1, one step's, into the histories, which are shifted by a step.");
    m.def(
        "split_loads",
        [](int64_t ahead, int64_t number, const WindowTables& window, const PairTables& pairs,
           Array<Strike, 1> strikes) {
            check_range("ahead", ahead, 0, 2);
            check_range("number", number, 0, INT64_MAX);
            check_window(window, window.quaternion_xyzw.shape[1]);
            check_pairs(pairs);
            check_range("count", pairs.count[0], 0, strikes.size() + 1);
            return split_loads(ahead, number, window, pairs, strikes);
        },
        "ahead"_a, "number"_a, "window"_a, "pairs"_a, "strikes"_a,
        "Find the strikes in the loads of a step, `ahead` after the one being rendered; return their number.");
}

void bind_strikes(nb::module_& m) {
    m.def(
        "set_gravity_steps",
        [](int64_t ahead, int64_t number, const PairTables& pairs, Array<const Body, 1> bodies, Doubles steps) {
            check_range("ahead", ahead, 0, 2);
            check_pairs(pairs);
            check_bodies_of(pairs, bodies.size());
            check_shape("gravity_steps", steps, bodies.size());
            set_gravity_steps(ahead, number, pairs, bodies, steps);
        },
        "ahead"_a, "number"_a, "pairs"_a, "bodies"_a, "gravity_steps"_a,
        "Set the steps (b,) for which gravity may have moved each mobile body although it rests.");
    m.def(
        "accept_strikes",
        [](Array<Strike, 1> strikes, Array<const Body, 1> bodies) {
            for (int64_t q = 0; q < strikes.size(); ++q)
                for (int64_t body : strikes[q].body) check_range("body of a strike", body, 0, bodies.size());
            ContactScratch memory;
            accept_strikes(strikes, bodies, room(memory.transmitted_n_s, bodies.size()));
        },
        "strikes"_a, "bodies"_a, "Bound strike impulses by their cause: accepted_n_s of the strikes (q,).");
    m.def("phase_in_step", &phase_in_step, "seed"_a, "count"_a,
          "Compute the fraction of a step at which a body's count-th undated impact acts.");
    m.def(
        "find_pulses",
        [](int64_t ahead, int64_t number, int64_t found, const WindowTables& window, const BodyTables& table,
           const PairTables& pairs, Array<Strike, 1> strikes, const ScratchTables& scratch) {
            check_range("ahead", ahead, 0, 2);
            check_range("number", number, 0, INT64_MAX);
            check_table(table);
            check_window(window, table);
            check_pairs(pairs);
            check_bodies_of(pairs, table.bodies.size());
            check_range("count", pairs.count[0], 0, strikes.size() + 1);
            check_range("found", found, 0, scratch.pulse.size() - pairs.count[0] + 1);
            check_shape("spectrum", table.spectrum, 2, table.spectrum.shape[1]);
            for (int64_t b = 0; b < table.bodies.size(); ++b) {
                const Body& body = table.bodies[b];
                check_range("columns", body.columns, 0, scratch.modal_impulse.shape[2] + 1);
                check_range("modes", body.modes, 0, table.frequency_hz.size() + 1);
                check_range("frequency_at", body.frequency_at, 0, table.frequency_hz.size() - body.modes + 1);
            }
            check_shape("modal_impulse", scratch.modal_impulse, scratch.pulse.size(), 2,
                        scratch.modal_impulse.shape[2]);
            nb::gil_scoped_release released;
            ContactScratch memory;
            return find_pulses(ahead, number, found, window, table, pairs, strikes, scratch, memory);
        },
        "ahead"_a, "number"_a, "found"_a, "window"_a, "table"_a, "pairs"_a, "strikes"_a, "scratch"_a,
        "Find the strikes that begin in a step, as pulses of the scratch from `found` on; return the new number.");
}

void bind_pulse(nb::module_& m) {
    m.def("contact_modulus", &contact_modulus, "low_pa"_a, "high_pa"_a, "Compute E* in Pa of two moduli E/(1-ν²).");
    m.def(
        "pulse_length",
        [](double mass_kg, double modulus_pa, double relative_curvature_per_m, double flat_area, double approach_m_s) {
            const auto [tau_s, flat] =
                pulse_length(mass_kg, modulus_pa, relative_curvature_per_m, flat_area, approach_m_s);
            return nb::make_tuple(tau_s, flat);
        },
        "mass_kg"_a, "modulus_pa"_a, "relative_curvature_per_m"_a, "flat_area_m2"_a, "approach_m_s"_a,
        "Compute the length τ in s of a pulse, and 1 where it is flat (a half-sine), 0 where it is Hertz'.");
    m.def("rough_stretch", &rough_stretch, "mass_kg"_a, "modulus_pa"_a, "relative_curvature_per_m"_a, "approach_m_s"_a,
          "layer_m"_a, "Compute how many times as long Hertz' pulse is on rough faces.");
    m.def(
        "compliance",
        [](Array<const double, 1> modal_impulse, Array<const double, 1> frequency_hz, double tau_s,
           Array<const double, 1> spectrum) {
            check_shape("frequency_hz", frequency_hz, modal_impulse.size());
            check_range("spectrum", spectrum.size(), 2, INT64_MAX);
            return compliance(modal_impulse.data, frequency_hz.data, modal_impulse.size(), tau_s, spectrum);
        },
        "modal_impulse"_a, "frequency_hz"_a, "tau_s"_a, "spectrum"_a,
        "Compute Σ (Uᵀj |F̂(fτ)|)² over the modes (m,) of a body.");
    m.def(
        "fill_pulse_table",
        [](Array<double, 2> table) {
            check_shape("table", table, 2, PULSE_CELLS + 1);
            for (int i = 0; i <= PULSE_CELLS; ++i)
                table(0, i) = pulse_table().q[i], table(1, i) = pulse_table().force[i];
        },
        "table"_a, "Fill Q and F (2, PULSE_CELLS + 1) of the Hertz pulse at equidistant fractions.");
    m.def(
        "cumulated",
        [](Array<const double, 1> s, bool flat, Doubles q) {
            check_shape("q", q, s.size());
            nb::gil_scoped_release released;
            for (int64_t i = 0; i < s.size(); ++i) q[i] = cumulated(s[i], flat);
        },
        "s"_a, "flat"_a, "q"_a, "Interpolate Q at the fractions s (n,) of a pulse into q (n,).");
}

void bind_place(nb::module_& m) {
    m.def(
        "find_contact_points",
        [](Array<ContactRow, 1> rows, const BodyTables& table) {
            check_table(table);
            check_rows(rows, table.bodies.size());
            check_touched(rows, table);
            nb::gil_scoped_release released;
            for (int64_t r = 0; r < rows.size(); ++r) find_contact_point(rows[r], table);
        },
        "rows"_a, "table"_a,
        "Find face, weights and curvature of the rows (k,) on either body: face, barycentric, curvature_per_m.");
    m.def(
        "add_modal_impulse",
        [](Array<const ContactRow, 1> rows, int64_t r, int64_t side, double factor, const BodyTables& table,
           Doubles out) {
            check_range("r", r, 0, rows.size());
            check_range("side", side, 0, 2);
            check_table(table);
            check_rows(rows, table.bodies.size());
            const Body& body = table.bodies[rows[r].body[side]];
            check_range("face", rows[r].face[side], -1, body.faces);
            if (rows[r].face[side] >= 0) check_range("columns", body.columns, 0, out.size() + 1);
            add_modal_impulse(rows[r], static_cast<int>(side), factor, table, out.data);
        },
        "rows"_a, "r"_a, "side"_a, "factor"_a, "table"_a, "out"_a,
        "Add factor·Uᵀj of row r on the body of a side, of its free modes, to out (columns,).");
    m.def(
        "turn_modal_impulse",
        [](Array<const Body, 1> bodies, int64_t b, Array<const Turn, 1> turns, Doubles out) {
            check_range("b", b, 0, bodies.size());
            const Body& body = bodies[b];
            if (body.turns > 0) check_range("turn_at", body.turn_at, 0, turns.size() - body.turns + 1);
            for (int64_t q = 0; q < body.turns; ++q)
                check_range("mode", turns[body.turn_at + q].mode, 0, out.size() - 1);
            turn_modal_impulse(body, turns, out.data);
        },
        "bodies"_a, "b"_a, "turns"_a, "out"_a,
        "Turn Uᵀj in out (columns,), of a body's free modes, to its modes as they are.");
    m.def(
        "effective_mass",
        [](Array<const Body, 1> bodies, int64_t low, int64_t high, Array<const double, 2> quaternion_xyzw,
           Array<const double, 1> arm_low_m, Array<const double, 1> arm_high_m, Array<const double, 1> normal) {
            const int64_t pair[2] = {low, high};
            for (int64_t b : pair) check_range("body", b, 0, std::min(bodies.size(), quaternion_xyzw.shape[0]));
            check_shape("quaternion_xyzw", quaternion_xyzw, quaternion_xyzw.shape[0], 4);
            double arm_m[2][3];
            const auto arm = {few<3>("arm_low_m", arm_low_m), few<3>("arm_high_m", arm_high_m)};
            for (int side = 0; side < 2; ++side)
                for (int x = 0; x < 3; ++x) arm_m[side][x] = (arm.begin() + side)->number[x];
            return effective_mass(bodies, pair, quaternion_xyzw, arm_m, few<3>("normal", normal).number);
        },
        "bodies"_a, "low"_a, "high"_a, "quaternion_xyzw"_a, "arm_low_m"_a, "arm_high_m"_a, "normal"_a,
        "Compute m* in kg of two bodies, 0 where neither moves; levers and normal (3,) in the world.");
    m.def(
        "flat_area_m2",
        [](Array<const Body, 1> bodies, int64_t low, int64_t high, double spread_m, double curvature_per_m,
           double least_fraction) {
            const int64_t pair[2] = {low, high};
            for (int64_t b : pair) check_range("body", b, 0, bodies.size());
            return flat_area_m2(bodies, pair, spread_m, curvature_per_m, least_fraction);
        },
        "bodies"_a, "low"_a, "high"_a, "spread_m"_a, "curvature_per_m"_a, "least_fraction"_a,
        "Compute the area of a flat contact of two bodies, 0 where it is curved.");
}

void bind_surfaces(nb::module_& m) {
    m.def(
        "height_octaves",
        [](double roughness_m, double hurst, Doubles height_m) {
            height_octaves(roughness_m, hurst, octaves("height_m", height_m));
        },
        "roughness_m"_a, "hurst"_a, "height_m"_a,
        "Write the heights A_j (OCTAVES,) in m, for lattice values on ±1, of an rms height and a Hurst exponent.");
    m.def(
        "add_waves",
        [](double rms_m, double length_m, Doubles height_m) {
            add_waves(rms_m, length_m, octaves("height_m", height_m));
        },
        "rms_m"_a, "length_m"_a, "height_m"_a, "Add waves of one length to heights (OCTAVES,), in power.");
    m.def(
        "slope_squared", [](Doubles height_m) { return slope_squared(octaves("height_m", height_m)); }, "height_m"_a,
        "Return the mean square slope of a trace over heights (OCTAVES,).");
    m.def("reach_of_ball", &reach_of_ball, "wave_m"_a, "patch_radius_m"_a, "radius_m"_a,
          "Compute the largest A of waves that a ball of R* with a Hertz patch a follows.");
    m.def(
        "close_round",
        [](double length_m, Doubles height_m) {
            const auto [points, stretch] = close_round(length_m, octaves("height_m", height_m));
            return nb::make_tuple(points, stretch);
        },
        "length_m"_a, "height_m"_a,
        "Close the lattice round a length: points of the coarsest octave's lattice, and its stretch over 1.");
    m.def(
        "gained_heights",
        [](Doubles height_m, double speed_m_s, double patch_radius_m, double touching, double ball_m, double sr,
           Doubles gained_m) {
            gained_heights(octaves("height_m", height_m), speed_m_s, {patch_radius_m, touching, ball_m}, sr,
                           octaves("gained_m", gained_m));
        },
        "height_m"_a, "speed_m_s"_a, "patch_radius_m"_a, "touching"_a, "ball_m"_a, "sr"_a, "gained_m"_a,
        "Write g_j A_j (OCTAVES,) at a sweep speed.");
    m.def(
        "sweep_profile",
        [](double swept_m, std::pair<double, double> speed_m_s, Array<const double, 1> x, int64_t seed, double around,
           double stretch, Array<const double, 2> height_m, double per_sample_s, Doubles rate_m_s) {
            check_shape("height_m", height_m, 2, OCTAVES);
            check_shape("rate_m_s", rate_m_s, x.size());
            const double speed[2] = {speed_m_s.first, speed_m_s.second};
            const auto& heights = *reinterpret_cast<const double (*)[2][OCTAVES]>(height_m.data);
            nb::gil_scoped_release released;
            std::vector<double> lattice, whole(x.size() + 8);
            swept_m = sweep_profile(swept_m, speed, x, {seed, {around, stretch}}, heights, per_sample_s, whole.data(),
                                    lattice);
            for (int64_t i = 0; i < x.size(); ++i) rate_m_s[i] += whole[i];
            return swept_m;
        },
        "swept_m"_a, "speed_m_s"_a, "x"_a, "seed"_a, "around"_a, "stretch"_a, "height_m"_a, "per_sample_s"_a,
        "rate_m_s"_a, "Add dh/dt of one side of a pair to samples (n,) in m/s; return the distance swept after them.");
    m.def(
        "sweep_track",
        [](double swept_m, std::pair<double, double> speed_m_s, Array<const double, 1> x, Array<const double, 2> slopes,
           double spacing_m, Array<const double, 2> gains, double per_sample_s, Doubles rate_m_s) {
            check_shape("gains", gains, 2, OCTAVES);
            check_shape("slopes", slopes, OCTAVES, slopes.shape[1]);
            check_range("slopes", slopes.shape[1], 1, INT64_MAX);
            check_shape("rate_m_s", rate_m_s, x.size());
            const double speed[2] = {speed_m_s.first, speed_m_s.second};
            const auto& both = *reinterpret_cast<const double (*)[2][OCTAVES]>(gains.data);
            nb::gil_scoped_release released;
            return sweep_track(swept_m, speed, x, {slopes.data, slopes.shape[1], spacing_m}, both, per_sample_s,
                               rate_m_s.data);
        },
        "swept_m"_a, "speed_m_s"_a, "x"_a, "slopes"_a, "spacing_m"_a, "gains"_a, "per_sample_s"_a, "rate_m_s"_a,
        "Add dh/dt of one side of a pair, by a track's slopes (OCTAVES, count), to samples (n,) in m/s.");
}

void bind_friction(nb::module_& m) {
    m.def("dissipation_s_m", &dissipation_s_m, "restitution"_a,
          "Compute c in s/m by the restitution of an impact at 1 m/s.");
    m.def("contact_radius_m", &contact_radius_m, "relative_curvature_per_m"_a, "flat_area_m2"_a,
          "Compute R* = 1/(κ1+κ2), at most the radius of the nominal contact area.");
    m.def("ball_patch_m", &ball_patch_m, "load_n"_a, "modulus_pa"_a, "radius_m"_a,
          "Compute the radius a in m of a ball's contact patch under a load.");
    m.def(
        "sound_voices",
        [](Array<Pair, 1> pairs, Array<Voice, 1> voices, Array<const double, 1> x, double sr,
           Array<const double, 1> tracks, Array<double, 2> force_n) {
            check_shape("force_n", force_n, voices.size(), x.size());
            for (int64_t v = 0; v < voices.size(); ++v) {
                check_range("slot", voices[v].slot, 0, pairs.size());
                const Pair& pair = pairs[voices[v].slot];
                for (int side = 0; side < 2; ++side) {
                    if (pair.track_count[side] <= 0) continue;
                    check_range("track_count", pair.track_count[side], 0, tracks.size() / OCTAVES + 1);
                    check_range("track_at", pair.track_at[side], 0,
                                tracks.size() - OCTAVES * pair.track_count[side] + 1);
                }
            }
            nb::gil_scoped_release released;
            ContactScratch memory;
            sound_voices(pairs, voices, x, sr, tracks, force_n, memory);
        },
        "pairs"_a, "voices"_a, "x"_a, "sr"_a, "tracks"_a, "force_n"_a,
        "Compute the force f - N in newton of voices into force_n (v, n), and advance their pairs.");
    m.def(
        "advance_friction",
        [](int64_t number, Array<const double, 1> x, double sr, const WindowTables& window, const BodyTables& table,
           const PairTables& pairs, const ScratchTables& scratch) {
            const int64_t most = pairs.count[0], columns = scratch.gain0.shape[2];
            check_range("number", number, 0, INT64_MAX);
            check_table(table);
            check_window(window, table);
            check_pairs(pairs);
            check_bodies_of(pairs, table.bodies.size());
            check_shape("gain", pairs.gain, pairs.pair.size(), 2, pairs.gain.shape[2]);
            check_range("columns", columns, 0, pairs.gain.shape[2] + 1);
            for (int64_t b = 0; b < table.bodies.size(); ++b)
                check_range("columns", table.bodies[b].columns, 0, columns + 1);
            check_range("drives", most, 0, scratch.slot.size() + 1);
            const int64_t drives = scratch.slot.size();
            check_range("force", drives * x.size(), 0, scratch.force.size() + 1);
            check_shape("gain0", scratch.gain0, drives, 2, columns);
            check_shape("gain1", scratch.gain1, drives, 2, columns);
            check_shape("direction0", scratch.direction0, drives, 3);
            check_shape("direction1", scratch.direction1, drives, 3);
            check_shape("body", scratch.body, drives, 2);
            check_shape("count", scratch.count, 2);
            nb::gil_scoped_release released;
            ContactScratch memory;
            advance_friction(number, x, sr, window, table, pairs, room(memory.voices, most), scratch, memory);
        },
        "number"_a, "x"_a, "sr"_a, "window"_a, "table"_a, "pairs"_a, "scratch"_a,
        "Compute the force signals of a step, a drive each, and write how many into scratch.count[1].");
}

}  // namespace

void bind_contact(nb::module_& m) {
    add_dtype<Contact>(m, "CONTACT");
    add_dtype<Window>(m, "WINDOW");
    add_dtype<Body>(m, "BODY");
    add_dtype<Turn>(m, "TURN");
    add_dtype<ContactRow>(m, "ROW");
    add_dtype<Pair>(m, "PAIR");
    add_dtype<ContactPatch>(m, "CONTACT_PATCH");
    add_dtype<SupportState>(m, "SUPPORT_STATE");
    add_dtype<Strike>(m, "STRIKE");
    add_dtype<Pulse>(m, "PULSE");
    add_dtype<Voice>(m, "VOICE");
    for (auto [name, value] : {std::pair{"SPAN", SPAN},
                               {"NOW", NOW},
                               {"LOOKAHEAD", LOOKAHEAD},
                               {"HISTORY", HISTORY},
                               {"PATCH_POINTS", PATCH_POINTS},
                               {"OCTAVES", OCTAVES},
                               {"PULSE_CELLS", PULSE_CELLS},
                               {"SPECTRUM_CELLS_PER_F_TAU", SPECTRUM_CELLS_PER_F_TAU}})
        m.attr(name) = value;
    for (auto [name, value] : {std::pair{"SHORTEST_PULSE_S", SHORTEST_PULSE_S},
                               {"LONGEST_PULSE_S", LONGEST_PULSE_S},
                               {"STRUCK_FLAT", STRUCK_FLAT},
                               {"PERSSON", PERSSON},
                               {"EDGE_MARGIN", EDGE_MARGIN},
                               {"CREASE_COS", CREASE_COS},
                               {"FLAT_CURVATURE", FLAT_CURVATURE},
                               {"SIZELESS_M", SIZELESS_M},
                               {"SAVED_S", SAVED_S},
                               {"FOLLOW_S", FOLLOW_S},
                               {"SWEEP_FLOOR_M_S", SWEEP_FLOOR_M_S},
                               {"FASTEST_M_S", FASTEST_M_S},
                               {"LONGEST_WAVE_M", LONGEST_WAVE_M},
                               {"UNIT_RMS", UNIT_RMS}})
        m.attr(name) = value;
    bind_loads(m);
    bind_strikes(m);
    bind_pulse(m);
    bind_place(m);
    bind_surfaces(m);
    bind_friction(m);
}

}  // namespace engine
