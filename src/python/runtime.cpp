// Python's door to src/runtime.
#include <algorithm>
#include <memory>

#include "../contact/coupling/turned_modes.hpp"
#include "../contact/load_splitting.hpp"
#include "../runtime/driver.hpp"
#include "arrays.hpp"

namespace engine {

namespace {

// A run time whose tables are arrays of Python's: `owner` keeps these as long as they are bound.
struct BoundRunTime {
    RunTime run;
    nb::list owner;
    bool bound = false;
};

void check_steps(const GivenSteps& given, const DriverCall& call, const Frames& frames, const RunTime& run) {
    const int64_t steps = given.steps.size(), bodies = run.window.position_m.shape[1];
    check_shape("position", given.position, steps, bodies, 3);
    check_shape("quaternion", given.quaternion, steps, bodies, 4);
    check_shape("teleported", given.teleported, steps, bodies);
    check_range("first", call.first, 0, steps + 1);
    check_range("taken", call.taken, 0, INT64_MAX);
    const int64_t samples = frames.out.shape[1];
    int64_t longest = 0;
    for (int64_t i = call.first; i < steps; ++i) {
        const StepRow& step = given.steps[i];
        check_range("row", step.row[0], 0, given.contacts.size() + 1);
        check_range("row", step.row[1], step.row[0], given.contacts.size() + 1);
        check_range("count", step.count, 0, samples + 1);
        if (step.count > 0) check_range("sample", step.sample - frames.start, 0, samples - step.count + 1);
        longest = step.count > longest ? step.count : longest;
    }
    for (const Contact* row = given.contacts.data; row < given.contacts.data + given.contacts.size(); ++row) {
        check_range("contact body", row->a, 0, bodies);
        check_range("contact body", row->b, 0, bodies);
    }
    const int64_t groups = frames.apart ? bodies : 1, sets = run.scratch.source.shape[0];
    check_shape("out", frames.out, groups * frames.reads.size(), samples);
    check_shape("pressure", frames.pressure, groups * frames.sets.size(), samples);
    check_shape("sets", frames.sets, run.path.microphone_m.shape[0]);
    int64_t microphones = 0;
    for (int64_t c = 0; c < frames.reads.size(); ++c) microphones += frames.reads[c] == 0;
    if (frames.out.data != frames.pressure.data) check_range("reads", microphones, 0, frames.sets.size() + 1);
    for (int64_t c = 0; c < frames.reads.size(); ++c) check_range("reads", frames.reads[c], 0, sets > 0 ? sets : 1);
    for (int64_t c = 0; c < frames.sets.size(); ++c) check_range("sets", frames.sets[c], 0, sets > 0 ? sets : 1);
    if (given.aim_m.size() > 0) check_shape("aim_m", given.aim_m, steps + 1, bodies, run.path.microphone_m.shape[0], 3);
    if (longest > run.scratch.source.shape[2] || longest > run.scratch.dipole.shape[2])
        throw nb::value_error("the scratch is shorter than a step");
}

// Check that a body's numbers lie within the flat arrays.
void check_mobility(const Mobility& one, const Body& body, const BankBody& lanes, const RunTime& run) {
    const PoleTables& poles = run.poles;
    const int64_t sets = run.bank.observed.shape[0];
    check_range("poles.modes", one.modes, body.modes, body.modes + 1);
    check_range("poles.mode_at", one.mode_at, 0, poles.omega_rad_s.size() - one.modes + 1);
    check_range("poles.weight_at", one.weight_at, 0, poles.weight.size() - sets * one.modes + 1);
    check_range("poles.pairs", one.pairs, 0, poles.pair.size() + 1);
    check_range("poles.pair_at", one.pair_at, 0, poles.pair.size() - one.pairs + 1);
    check_range("poles.follows", one.follows, 0, poles.follow.size() + 1);
    check_range("poles.follow_at", one.follow_at, 0, poles.follow.size() - one.follows + 1);
    check_range("poles.columns", lanes.columns, one.modes + one.follows, INT64_MAX);
    int64_t free = 0;
    for (int64_t i = one.pair_at; i < one.pair_at + one.pairs; ++i) {
        check_range("poles.pair", poles.pair[i], free, one.modes - 1);
        free = poles.pair[i] + 2;
    }
    for (int64_t i = one.follow_at; i < one.follow_at + one.follows; ++i)
        check_range("poles.follow", poles.follow[i], 0, one.modes);
    if (one.pairs == 0) return;
    check_range("turn_at", body.turn_at, 0, run.table.turns.size() - one.pairs + 1);
    check_range("turns", body.turns, 0, one.pairs + 1);
}

void check_poles(const RunTime& run) {
    const int64_t bodies = run.table.bodies.size(), lanes = run.bank.law.shape[1];
    const int64_t partners = run.bank.transmissions.shape[1], sets = run.bank.observed.shape[0];
    const TouchSides& sides = run.poles.sides;
    check_shape("bank.coming", run.bank.coming, 8, lanes);
    check_shape("bank.transmissions", run.bank.transmissions, bodies, partners);
    check_shape("bank.transmission_weight", run.bank.transmission_weight, partners * sets, 2 * lanes);
    check_shape("poles.mobility", run.poles.mobility, bodies);
    check_shape("poles.decay_per_s", run.poles.decay_per_s, run.poles.omega_rad_s.size());
    check_shape("poles.free_law", run.poles.free_law, 6, lanes);
    for (const auto& side : {sides.compliance_per_pa, sides.poisson, sides.loss_factor, sides.roughness_m})
        check_shape("poles.sides", side, bodies);
    check_shape("poles.sides", sides.slips, bodies);
    check_shape("poles.sides", sides.turns, bodies, 3, 3);
    for (int64_t b = 0; b < bodies; ++b)
        check_mobility(run.poles.mobility[b], run.table.bodies[b], run.bank.body[b], run);
}

void check_tables(const RunTime& run) {
    const int64_t bodies = run.table.bodies.size(), slots = run.pairs.pair.size();
    check_shape("window.step", run.window.step, SPAN);
    check_shape("window.position_m", run.window.position_m, SPAN, bodies, 3);
    check_shape("window.quaternion_xyzw", run.window.quaternion_xyzw, SPAN, bodies, 4);
    check_shape("window.teleported", run.window.teleported, SPAN, bodies);
    check_shape("pairs.active", run.pairs.active, slots);
    check_shape("pairs.free", run.pairs.free, slots);
    check_shape("pairs.patch", run.pairs.patch, slots);
    check_shape("pairs.count", run.pairs.count, 2);
    check_range("pairs.count", run.pairs.count[0], 0, slots + 1);
    check_range("pairs.count", run.pairs.count[1], 0, slots + 1);
    check_shape("supports.support_state", run.supports.support_state, bodies);
    check_shape("bank.body", run.bank.body, bodies);
    check_shape("bank.ringing", run.bank.ringing, bodies);
    check_shape("path.sources", run.path.sources, bodies);
    check_shape("path.lines", run.path.lines, run.path.places.size() * run.path.microphone_m.shape[0]);
    const int64_t lanes = run.bank.law.shape[1], sets = run.bank.weight.shape[0];
    check_range("bank.weight sets", sets, 1, INT64_MAX);
    check_shape("bank.law", run.bank.law, 7, lanes);
    check_shape("bank.z", run.bank.z, 2 * lanes);
    check_shape("bank.driven", run.bank.driven, 2 * lanes);
    check_shape("bank.pole", run.bank.pole, 2 * lanes);
    check_shape("bank.block", run.bank.block, 2 * lanes);
    check_shape("bank.weight", run.bank.weight, sets, 2 * lanes);
    check_shape("bank.observed", run.bank.observed, sets, bodies);
    check_shape("bank.free", run.bank.free, run.bank.strikes.size() + 1);
    for (int64_t b = 0; b < bodies; ++b) {
        const BankBody& body = run.bank.body[b];
        check_range("bank.body start", body.start, 0, lanes + 1);
        check_range("bank.body stop", body.stop, body.start, lanes + 1);
        check_range("bank.body columns", body.columns, 0, body.stop - body.start + 1);
    }
    check_poles(run);
    const auto check_slots = [slots](const char* name, Array<const int64_t, 1> places, int64_t count) {
        for (int64_t i = 0; i < count; ++i) check_range(name, places[i], 0, slots);
    };
    check_slots("pairs.active", run.pairs.active, run.pairs.count[0]);
    check_slots("pairs.free", run.pairs.free, run.pairs.count[1]);
}

// A copy for Python of numbers of this shape.
template <class T, int N>
nb::object copied(const T* data, const int64_t (&shape)[N]) {
    Array<T, N> view;
    nb::object made = new_array(view, shape);
    int64_t count = 1;
    for (const int64_t length : shape) count *= length;
    std::copy_n(data, count, view.data);
    return made;
}

// Check that tables are bound, and that body b has modes.
RunTime& bound(BoundRunTime& self, int64_t b) {
    if (!self.bound) throw nb::value_error("no tables are bound");
    check_range("body", b, 0, self.run.poles.mobility.size());
    check_range("modes", self.run.poles.mobility[b].modes, 1, INT64_MAX);
    return self.run;
}

}  // namespace

void bind_runtime(nb::module_& m) {
    add_dtype<StepRow>(m, "STEP");
    add_dtype<Mobility>(m, "MOBILITY");
    m.attr("STOPPED_TURN") = STOPPED_TURN;
    for (auto [name, value] : {std::pair{"STEPS_DONE", int64_t{STEPS_DONE}},
                               {"TABLE_SHORT", TABLE_SHORT},
                               {"PAUSED", PAUSED},
                               {"BROKEN", BROKEN},
                               {"STEP_NEW", STEP_NEW},
                               {"STEP_RINGS", STEP_RINGS}})
        m.attr(name) = value;
    m.def(
        "limit_poles",
        [](Array<Complex, 1> step, Array<const Complex, 1> free) {
            check_shape("free", free, step.size());
            for (int64_t k = 0; k < step.size(); ++k) step[k] = limit_pole(step[k], free[k]);
        },
        "step"_a, "free"_a, "Limit poles (m,) a sample to what the bank can play, in place.");
    nb::class_<BoundRunTime>(m, "RunTime", "The run time's stages, on tables that Python makes and keeps.")
        .def(nb::init<>())
        .def(
            "bind",
            [](BoundRunTime& self, nb::handle window, nb::handle table, nb::handle pairs, nb::handle supports,
               nb::handle bank, nb::handle scratch, nb::handle path, nb::handle poles) {
                nb::list owner;
                auto fresh = std::make_unique<RunTime>();  // the tables as they were stay where one of these is refused
                read_group(window, fresh->window, &owner);
                read_group(table, fresh->table, &owner);
                read_group(pairs, fresh->pairs, &owner);
                read_group(supports, fresh->supports, &owner);
                read_group(bank, fresh->bank, &owner);
                read_group(scratch, fresh->scratch, &owner);
                read_group(path, fresh->path, &owner);
                read_group(poles, fresh->poles, &owner);
                check_tables(*fresh);
                self.run.window = fresh->window;
                self.run.table = fresh->table;
                self.run.pairs = fresh->pairs;
                self.run.supports = fresh->supports;
                self.run.bank = fresh->bank;
                self.run.scratch = fresh->scratch;
                self.run.path = fresh->path;
                self.run.poles = fresh->poles;
                self.owner = owner;
                self.bound = true;
            },
            nb::kw_only(), "window"_a, "table"_a, "pairs"_a, "supports"_a, "bank"_a, "scratch"_a, "path"_a, "poles"_a,
            "Take the tables from objects, or tuples of objects, that have them as attributes, until others are "
            "bound.")
        .def(
            "turn_modes",
            [](BoundRunTime& self, int64_t b, Array<const Turn, 1> after, bool free) {
                const RunTime& run = bound(self, b);
                const Mobility& one = run.poles.mobility[b];
                check_shape("after", after, free ? 0 : one.pairs);
                for (int64_t i = 0; i < after.size(); ++i)
                    check_range("mode", after[i].mode, run.poles.pair[one.pair_at + i],
                                run.poles.pair[one.pair_at + i] + 1);
                std::vector<Turn> turns;
                return turn_modes(b, after, free, {run.table, run.bank, run.scratch, run.pairs}, turns);
            },
            "b"_a, "after"_a, "free"_a,
            "Turn the modes of a body to these TURN rows, one for each of its pairs, or to its free ones; return\n"
            "whether that is more than almost nothing.")
        .def(
            "couple_body",
            [](BoundRunTime& self, int64_t b, Array<const double, 2> quaternion) {
                RunTime& run = bound(self, b);
                check_shape("quaternion", quaternion, run.table.bodies.size(), 4);
                const ContactState state{run.table, run.pairs, run.bank, run.scratch, run.poles};
                CoupledBody& body = run.pole_work.body;
                if (!couple_body(b, quaternion, state, run.pole_work)) throw nb::value_error("not finite");
                const int64_t m = body.touches ? run.poles.mobility[b].modes : 0;
                if (!body.touches) body.load_n.clear(), body.spring.clear(), body.poles = {};
                const int64_t partner_modes = body.poles.moved.shape[1];
                return nb::make_tuple(
                    copied(body.load_n.data(), {body.touches}), copied(body.spring.data(), {3 * body.touches}),
                    copied(body.poles.omega_rad_s.data, {m}), copied(body.poles.decay_per_s.data, {m}),
                    copied(body.poles.shares.data, {m, 3}), copied(body.poles.motion.data, {m, m}),
                    copied(body.poles.moved.data, {2, partner_modes, m}));
            },
            "b"_a, "quaternion"_a,
            "Compute a body's touches and coupled modes, and change nothing: load (c,), springs (3c,), those that are\n"
            "0 last, ω, d (m,), the decay's parts (m, 3) (its own, the contacts', the partners'), each mode's motion\n"
            "(m, m) by rows, and velocities (2, P, m) of the partners' modes for a velocity of 1 of a motion.")
        .def(
            "update_poles",
            [](BoundRunTime& self, int64_t b, Array<const double, 2> quaternion, double sr) {
                RunTime& run = bound(self, b);
                check_shape("quaternion", quaternion, run.table.bodies.size(), 4);
                const ContactState state{run.table, run.pairs, run.bank, run.scratch, run.poles};
                if (!update_poles(b, quaternion, sr, state, run.pole_work)) throw nb::value_error("not finite");
            },
            "b"_a, "quaternion"_a, "sr"_a,
            "Set a body's poles, and what it transmits, to those of its contacts, as the driver does.")
        .def(
            "advance_steps",
            [](BoundRunTime& self, int64_t first, int64_t taken, bool pause, int64_t resume, double sr,
               Array<const StepRow, 1> steps, Array<const Contact, 1> contacts, Array<const double, 3> position,
               Array<const double, 3> quaternion, Array<const bool, 2> teleported, Array<const double, 4> aim_m,
               int64_t start, bool apart, Array<const int64_t, 1> reads, Array<const int64_t, 1> sets,
               Array<double, 2> pressure, Array<double, 2> out) {
                if (!self.bound) throw nb::value_error("no tables are bound");
                const DriverCall call{first, taken, pause, resume, sr};
                const GivenSteps given{steps, contacts, position, quaternion, teleported, aim_m};
                const Frames frames{start, apart, reads, sets, pressure, out};
                check_steps(given, call, frames, self.run);
                DriverResult result;
                {
                    nb::gil_scoped_release released;
                    result = advance_steps(call, given, frames, self.run);
                }
                return nb::make_tuple(result.done, result.status);
            },
            "first"_a, "taken"_a, "pause"_a, "resume"_a, "sr"_a, "steps"_a, "contacts"_a, "position"_a, "quaternion"_a,
            "teleported"_a, "aim_m"_a, "start"_a, "apart"_a, "reads"_a, "sets"_a, "pressure"_a, "out"_a,
            "Render the steps from `first` on into out; return how many are done, and why it returned.");
}

}  // namespace engine
