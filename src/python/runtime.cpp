// Python's door to src/runtime.
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
    const auto check_slots = [slots](const char* name, Array<const int64_t, 1> places, int64_t count) {
        for (int64_t i = 0; i < count; ++i) check_range(name, places[i], 0, slots);
    };
    check_slots("pairs.active", run.pairs.active, run.pairs.count[0]);
    check_slots("pairs.free", run.pairs.free, run.pairs.count[1]);
}

}  // namespace

void bind_runtime(nb::module_& m) {
    add_dtype<StepRow>(m, "STEP");
    for (auto [name, value] : {std::pair{"STEPS_DONE", int64_t{STEPS_DONE}},
                               {"TABLE_SHORT", TABLE_SHORT},
                               {"PAUSED", PAUSED},
                               {"BROKEN", BROKEN},
                               {"POLES_WANTED", POLES_WANTED},
                               {"STEP_NEW", STEP_NEW},
                               {"STEP_RINGS", STEP_RINGS},
                               {"STEP_EXCITED", STEP_EXCITED}})
        m.attr(name) = value;
    nb::class_<BoundRunTime>(m, "RunTime", "The run time's stages, on tables that Python makes and keeps.")
        .def(nb::init<>())
        .def(
            "bind",
            [](BoundRunTime& self, nb::handle window, nb::handle table, nb::handle pairs, nb::handle supports,
               nb::handle bank, nb::handle scratch, nb::handle path) {
                nb::list owner;
                auto fresh = std::make_unique<RunTime>();  // the tables as they were stay where one of these is refused
                read_group(window, fresh->window, &owner);
                read_group(table, fresh->table, &owner);
                read_group(pairs, fresh->pairs, &owner);
                read_group(supports, fresh->supports, &owner);
                read_group(bank, fresh->bank, &owner);
                read_group(scratch, fresh->scratch, &owner);
                read_group(path, fresh->path, &owner);
                check_tables(*fresh);
                self.run.window = fresh->window;
                self.run.table = fresh->table;
                self.run.pairs = fresh->pairs;
                self.run.supports = fresh->supports;
                self.run.bank = fresh->bank;
                self.run.scratch = fresh->scratch;
                self.run.path = fresh->path;
                self.owner = owner;
                self.bound = true;
            },
            nb::kw_only(), "window"_a, "table"_a, "pairs"_a, "supports"_a, "bank"_a, "scratch"_a, "path"_a,
            "Take the tables from objects, or tuples of objects, that have them as attributes, until others are "
            "bound.")
        .def(
            "turn_modes",
            [](BoundRunTime& self, int64_t b, Array<const int64_t, 1> pairs, Array<const double, 2> before,
               Array<const double, 2> after, Array<double, 2> weight, Array<double, 2> transmission_weight) {
                if (!self.bound) throw nb::value_error("no tables are bound");
                const RunTime& run = self.run;
                check_range("body", b, 0, run.bank.body.size());
                const int64_t columns = run.bank.body[b].columns, lanes = 2 * run.bank.law.shape[1];
                for (const auto& turn : {before, after})
                    if (turn.size()) check_shape("turn", turn, turn.shape[0], turn.shape[0]);
                const int64_t modes = std::max(before.size(), after.size());
                check_range("modes", modes, 0, columns + 1);
                for (int64_t i = 0; i < pairs.size() && modes; ++i) {
                    check_range("pairs", pairs[i], 0, modes - 1);
                    if (before.size() && after.size()) check_shape("turn", before, after.size(), after.size());
                }
                check_shape("weight", weight, weight.shape[0], lanes);
                check_shape("transmission_weight", transmission_weight, transmission_weight.shape[0], lanes);
                if (!modes) return false;
                return turn_modes(b, pairs, before, after,
                                  {run.bank, weight, transmission_weight, run.scratch, run.pairs});
            },
            "b"_a, "pairs"_a, "before"_a, "after"_a, "weight"_a, "transmission_weight"_a,
            "Turn the modes of a body from `before` to `after`, (m, m) each or (0, 0) for the identity; return "
            "whether\n"
            "that is more than nothing.")
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
