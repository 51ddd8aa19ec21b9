// Python's door to src/listener, and PyBullet's answers -> rows: tuples are read here, where no object is made of them.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "../listener/kinematics.hpp"
#include "../listener/loaded_contacts.hpp"
#include "../listener/mujoco_motion.hpp"
#include "../listener/soft_impacts.hpp"
#include "../listener/step_batch.hpp"
#include "../listener/step_contacts.hpp"
#include "../listener/step_start.hpp"
#include "arrays.hpp"

namespace engine {

namespace {

// Pauses the garbage collector: PyBullet answers with thousands of tuples, which it would traverse in vain.
struct CollectorPause {
    int was_on = PyGC_Disable();
    ~CollectorPause() {
        if (was_on) PyGC_Enable();
    }
};

double number_at(PyObject* tuple, Py_ssize_t place) {
    PyObject* item = PyTuple_GetItem(tuple, place);
    if (item == nullptr) nb::raise_python_error();
    const double value = PyFloat_AsDouble(item);
    if (value == -1.0 && PyErr_Occurred() != nullptr) nb::raise_python_error();
    return value;
}

int64_t index_at(PyObject* tuple, Py_ssize_t place) {
    PyObject* item = PyTuple_GetItem(tuple, place);
    if (item == nullptr) nb::raise_python_error();
    const int64_t value = PyLong_AsLongLong(item);
    if (value == -1 && PyErr_Occurred() != nullptr) nb::raise_python_error();
    return value;
}

template <int N>
void numbers_at(PyObject* tuple, Py_ssize_t place, double (&numbers)[N]) {
    PyObject* item = PyTuple_GetItem(tuple, place);
    if (item == nullptr) nb::raise_python_error();
    for (int x = 0; x < N; ++x) numbers[x] = number_at(item, x);
}

// A copy of rows for Python.
template <class T>
nb::object copied(const T* data, int64_t count) {
    Array<T, 1> rows;
    nb::object made = new_array(rows, {count});
    std::copy_n(data, count, rows.data);
    return made;
}
template <class T>
Array<const T, 1> viewed(const std::vector<T>& rows) {
    return {rows.data(), {static_cast<int64_t>(rows.size())}};
}

// Tell whether one of PyBullet's contacts carries a force. NaN counts as a force, so that it is found. Bullet lists
// neighbours up to 2 cm apart too.
bool is_loaded(PyObject* contact) {
    if (!PyTuple_Check(contact)) throw nb::type_error("a contact that is no tuple");
    return !(number_at(contact, 9) == 0 && number_at(contact, 10) == 0 && number_at(contact, 12) == 0);
}

// Write rows of those of PyBullet's contacts that carry a force.
void pack_rows(PyObject* contacts, std::vector<ReportedContact>& rows) {
    const Py_ssize_t count = PyTuple_Size(contacts);
    if (count < 0) nb::raise_python_error();
    rows.clear();
    for (Py_ssize_t i = 0; i < count; ++i) {
        PyObject* one = PyTuple_GetItem(contacts, i);
        if (!is_loaded(one)) continue;
        ReportedContact row;
        row.force_n = number_at(one, 9), row.friction_1_n = number_at(one, 10), row.friction_2_n = number_at(one, 12);
        row.body_a = index_at(one, 1), row.body_b = index_at(one, 2);
        row.link_a = index_at(one, 3), row.link_b = index_at(one, 4);
        numbers_at(one, 5, row.point_a_m), numbers_at(one, 6, row.point_b_m), numbers_at(one, 7, row.normal);
        row.gap_m = number_at(one, 8);
        numbers_at(one, 11, row.tangent_1), numbers_at(one, 13, row.tangent_2);
        rows.push_back(row);
    }
}

nb::object pack_contacts(nb::tuple contacts) {
    std::vector<ReportedContact> rows;
    pack_rows(contacts.ptr(), rows);
    return copied(rows.data(), static_cast<int64_t>(rows.size()));
}

nb::object call(PyObject* question, PyObject* arguments) {
    nb::object answer = nb::steal(PyObject_Call(question, arguments, nullptr));
    if (!answer.is_valid()) nb::raise_python_error();
    return answer;
}

// A body as it is asked for its links.
struct AskedBody {
    PyObject* arguments;  // of the questions about a body; kept alive by the reader's `bodies`
    int64_t joints;
    bool fixed;                // of mass 0
    PyObject* link_arguments;  // of the question about links
    bool moves_unseen;         // of mass 0, and moved by somebody whom no hook saw
    bool known;                // of mass 0, and where it was last time
    LinkState base;
};

// Asks for poses and twists of a roster's links.
//
// A body of mass 0 that nobody moves stays where it is. Where hooks see who moves it (`forget`), it is asked for in
// turn, one body a step; one that has moved unseen is asked for each time from then on.
class StateReader {
public:
    // bodies: of each, the arguments of the first three questions, its joints, whether its mass is 0, and the arguments
    // of the last one.
    StateReader(nb::object joint_count, nb::object pose, nb::object twist, nb::object link_states, nb::tuple bodies,
                int64_t links, bool hooked)
        : joint_count_(joint_count),
          pose_(pose),
          twist_(twist),
          link_states_(link_states),
          owner_(bodies),
          links_(links),
          hooked_(hooked) {
        int64_t rows = 0;
        for (nb::handle entry : bodies) {
            PyObject* body = entry.ptr();
            const int64_t joints = index_at(body, 1);
            check_range("joints", joints, 0, INT32_MAX);
            rows += joints + 1;
            bodies_.push_back(
                {PyTuple_GetItem(body, 0), joints, index_at(body, 2) != 0, PyTuple_GetItem(body, 3), false, false, {}});
            if (bodies_.back().fixed) fixed_.push_back(bodies_.size() - 1);
        }
        check_range("links", rows, links, links + 1);
    }

    // Ask each of a mass of 0 anew, as one of them may have been moved.
    void forget() {
        for (const size_t i : fixed_) bodies_[i].known = false;
    }

    // Return LINK_STATE rows (n,), and 1 where all numbers are within INVALID_BEYOND, 0 where not. A body that has
    // another number of joints than before is another, which has taken over its id: asking it for a link that is not
    // there would end the process. Its place is returned instead, as -1 − place.
    nb::tuple read() {
        Array<LinkState, 1> states;
        const nb::object table = new_array(states, {links_});
        return nb::make_tuple(table, read_into(states));
    }

    int64_t links() const { return links_; }

    // Fill the states of all links, and return what `read` does.
    int64_t read_into(Array<LinkState, 1> states) {
        CollectorPause pause;
        if (!fixed_.empty()) turn_ = (turn_ + 1) % fixed_.size();
        int64_t row = 0;
        for (size_t place = 0; place < bodies_.size(); ++place) {
            AskedBody& body = bodies_[place];
            LinkState& base = states[row++];
            if (body.known && !body.moves_unseen && place != fixed_[turn_] && body.joints == 0) {
                base = body.base;
                continue;
            }
            const nb::object count = call(joint_count_.ptr(), body.arguments);
            if (PyLong_AsLongLong(count.ptr()) != body.joints) return -1 - static_cast<int64_t>(place);
            if (body.known && !body.moves_unseen && place != fixed_[turn_])
                base = body.base;
            else
                ask_base(body, base);
            if (body.joints > 0) ask_links(body, states, row);
            row += body.joints;
        }
        constexpr int64_t numbers = sizeof(LinkState) / sizeof(double);
        const auto* number = reinterpret_cast<const double*>(states.data);
        for (int64_t i = 0; i < states.size() * numbers; ++i)
            if (!(std::fabs(number[i]) < INVALID_BEYOND)) return 0;
        return 1;
    }

private:
    void ask_base(AskedBody& body, LinkState& base) {
        base = {};
        const nb::object pose = call(pose_.ptr(), body.arguments);
        numbers_at(pose.ptr(), 0, base.position_m), numbers_at(pose.ptr(), 1, base.quaternion_xyzw);
        if (!body.fixed) {
            const nb::object twist = call(twist_.ptr(), body.arguments);
            numbers_at(twist.ptr(), 0, base.velocity_m_s), numbers_at(twist.ptr(), 1, base.spin_rad_s);
            return;
        }
        if (body.known && std::memcmp(&base, &body.base, sizeof base) != 0) body.moves_unseen = true;
        body.base = base, body.known = hooked_;
    }
    void ask_links(const AskedBody& body, Array<LinkState, 1> states, int64_t row) {
        const nb::object answer = call(link_states_.ptr(), body.link_arguments);
        for (int64_t i = 0; i < body.joints; ++i) {
            PyObject* link = PyTuple_GetItem(answer.ptr(), i);
            if (link == nullptr) nb::raise_python_error();
            LinkState& state = states[row + i];
            numbers_at(link, 0, state.position_m), numbers_at(link, 1, state.quaternion_xyzw);
            numbers_at(link, 6, state.velocity_m_s), numbers_at(link, 7, state.spin_rad_s);
        }
    }

    nb::object joint_count_, pose_, twist_, link_states_;
    nb::tuple owner_;
    int64_t links_;
    bool hooked_;
    std::vector<AskedBody> bodies_;
    std::vector<size_t> fixed_;  // places of the bodies of mass 0
    size_t turn_ = 0;            // which of them is asked
};

void check_traces(const TraceTables& traces, int64_t contacts) {
    const int64_t capacity = traces.table.shape[1];
    check_shape("traces' table", traces.table, MEMORY_STEPS + 1, capacity);
    check_shape("traces' count", traces.count, MEMORY_STEPS + 1);
    check_shape("traces' sorting", traces.sorting, 3, capacity);
    check_range("contacts", contacts, 0, capacity + 1);
    check_range("newest", traces.newest, 0, MEMORY_STEPS + 1);
    for (int64_t i = 0; i <= MEMORY_STEPS; ++i) check_range("traces' count", traces.count[i], 0, capacity + 1);
}

// Check that the traces that a step is sorted by are those of that step.
void check_order(const TraceTables& traces) {
    for (int64_t step = 0; step <= MEMORY_STEPS; ++step)
        for (int64_t i = 0; i < traces.count[step]; ++i)
            check_range("order of a trace", traces.table(step, i).order, 0, traces.count[step]);
}

void check_poses(const BodyPoses& poses, Array<LinkStart, 1> start) {
    const int64_t bodies = poses.teleported.size();
    check_shape("position_m", poses.position_m, bodies, 3);
    check_shape("quaternion_xyzw", poses.quaternion_xyzw, bodies, 4);
    for (int64_t i = 0; i < start.size(); ++i)
        if (start[i].index >= 0) check_range("pose", start[i].pose, 0, bodies);
}

// Settings of the engine that a step has.
struct EngineSettings {
    double dt_s = 0;
    int64_t substeps = 0;
    double gravity_m_s2[3] = {0, 0, 0};
    bool operator==(const EngineSettings&) const = default;
};

constexpr int64_t NO_ROOM = -100;  // more contacts than the traces have room for

// What is asked of one client at each step, and the steps of it that wait. Steps of unusual cases are made elsewhere.
class StepReader {
public:
    StepReader(nb::object contacts, nb::object parameters, int64_t client_id)
        : contacts_(contacts), parameters_(parameters), arguments_(nb::make_tuple(client_id)) {
        options_["physicsClientId"] = client_id;
        for (const char* name :
             {"fixedTimeStep", "numSubSteps", "gravityAccelerationX", "gravityAccelerationY", "gravityAccelerationZ"})
            names_.append(nb::steal(PyUnicode_InternFromString(name)));
    }

    // Read the settings; tell whether they are others than before.
    bool read_settings() {
        const EngineSettings now = ask_settings();
        if (known_ && now == settings_) return false;
        settings_ = now, known_ = true;
        return true;
    }
    nb::tuple settings() const {
        const double* gravity = settings_.gravity_m_s2;
        return nb::make_tuple(settings_.dt_s, settings_.substeps, nb::make_tuple(gravity[0], gravity[1], gravity[2]));
    }

    // Ask for the contacts, keep rows of those that carry a force, and return the answer. Where no step is known to be
    // made, they are kept only if they differ from the last ones.
    nb::object poll(bool stepped) {
        CollectorPause pause;
        const nb::tuple none;
        nb::object contacts = nb::steal(PyObject_Call(contacts_.ptr(), none.ptr(), options_.ptr()));
        if (!contacts.is_valid()) nb::raise_python_error();
        pack_rows(contacts.ptr(), fresh_);
        keep_fresh(stepped);
        return contacts;
    }
    // Take rows in place of an answer.
    void give(Array<const ReportedContact, 1> rows) {
        fresh_.assign(rows.data, rows.data + rows.size());
        keep_fresh(true);
    }
    // Forget the contacts of the poll before the last.
    void forget_before() { reported_before_ = reported_; }
    nb::object reported() const { return copied(reported_.data(), size(reported_)); }
    nb::object reported_before() const { return copied(reported_before_.data(), size(reported_before_)); }
    int64_t count() const { return size(reported_); }

    // Loaded contacts of the step before.
    nb::object loaded() const { return copied(loaded_before_.data(), size(loaded_before_)); }
    void set_loaded(Array<const LoadedContact, 1> rows) { loaded_before_.assign(rows.data, rows.data + rows.size()); }

    // Keep the tables on which steps are made until others are bound; no step may wait.
    void bind(nb::handle traces, nb::object start, int64_t bodies) {
        if (!batch_.step.empty()) throw nb::value_error("steps of other bodies wait");
        nb::list owner;
        auto fresh_traces = traces_;  // those that are bound stay where these are refused
        auto fresh_start = start_;
        read_group(traces, fresh_traces, &owner);
        check_traces(fresh_traces, 0);
        check_order(fresh_traces);
        if (!view(start, fresh_start)) refuse("start");
        check_range("bodies", bodies, 0, INT64_MAX);
        for (int64_t i = 0; i < fresh_start.size(); ++i)
            if (fresh_start[i].index >= 0) check_range("pose", fresh_start[i].pose, 0, bodies);
        traces_ = fresh_traces, start_ = fresh_start;
        owner_ = owner, start_owner_ = start;
        clear_batch(batch_, bodies);
    }

    // Add the step that was read to those that wait: the number of its rows or, with nothing changed, why not.
    int64_t take(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later,
                 Array<const int64_t, 1> moved_bodies, bool hooked, double dt_s, nb::tuple gravity_m_s2, double time_s,
                 int64_t newest) {
        traces_.newest = newest;
        check_traces(traces_, count());
        check_shape("earlier", earlier, start_.size());
        check_shape("later", later, start_.size());
        double gravity[3];
        for (int x = 0; x < 3; ++x) gravity[x] = number_at(gravity_m_s2.ptr(), x);
        return take_read(earlier, later, moved_bodies, hooked, dt_s, gravity, time_s);
    }

    // Take steps as usual ones from now on, while nothing but the simulation itself changes: `earlier` was read before
    // the last one. body_count: asks for the number of bodies in the world, which is `bodies`.
    void expect_usual(Array<const LinkState, 1> earlier, double time_s, int64_t newest, nb::object body_count,
                      int64_t bodies) {
        check_shape("earlier", earlier, start_.size());
        before_.assign(earlier.data, earlier.data + earlier.size());
        time_s_ = time_s, traces_.newest = newest, body_count_ = body_count, bodies_ = bodies, usual_ = 0;
    }
    // Read what a usual step is taken from, before it is made. False where settings, bodies or numbers are others: then
    // nothing has changed.
    bool begin_usual(StateReader& states) {
        if (!(known_ && ask_settings() == settings_) || states.links() != start_.size()) return false;
        const nb::object count = call(body_count_.ptr(), arguments_.ptr());
        if (PyLong_AsLongLong(count.ptr()) != bodies_) return false;
        now_.resize(static_cast<size_t>(start_.size()));
        return states.read_into({now_.data(), {start_.size()}}) == 1;
    }
    // Add the step just made, whose begin was read: the number of its rows or, once contacts were asked for, why it is
    // no usual one.
    int64_t end_usual() {
        poll(true);
        if (count() > traces_.table.shape[1]) return NO_ROOM;
        const int64_t rows = take_read(viewed(before_), viewed(now_), {nullptr, {0}}, true, settings_.dt_s,
                                       settings_.gravity_m_s2, time_s_);
        if (rows < 0) return rows;
        now_.swap(before_);
        time_s_ += settings_.dt_s;
        traces_.newest = traces_.newest == 0 ? MEMORY_STEPS : traces_.newest - 1;
        ++usual_;
        return rows;
    }
    // How many usual steps were added, the time after them and the trace's next table; and the states read before the
    // last of them. It counts anew from here.
    nb::tuple usual_steps() {
        const int64_t steps = usual_;
        usual_ = 0;
        return nb::make_tuple(steps, time_s_, traces_.newest, copied(before_.data(), size(before_)));
    }
    // States read before the step just made.
    nb::object read_states() const { return copied(now_.data(), size(now_)); }
    int64_t waiting() const { return size(batch_.step); }
    int64_t waiting_contacts() const { return size(batch_.contact); }

    // The tables of the steps that wait, of which none waits any more: steps, contacts, poses.
    nb::tuple taken() {
        const int64_t steps = waiting(), bodies = batch_.bodies;
        Array<double, 3> position_m, quaternion_xyzw;
        Array<bool, 2> moved;
        nb::object place = new_array(position_m, {steps, bodies, 3}),
                   turn = new_array(quaternion_xyzw, {steps, bodies, 4}), by_hand = new_array(moved, {steps, bodies});
        std::copy(batch_.position_m.begin(), batch_.position_m.end(), position_m.data);
        std::copy(batch_.quaternion_xyzw.begin(), batch_.quaternion_xyzw.end(), quaternion_xyzw.data);
        std::copy(batch_.moved.begin(), batch_.moved.end(), moved.data);
        nb::tuple tables = nb::make_tuple(copied(batch_.step.data(), steps),
                                          copied(batch_.contact.data(), size(batch_.contact)), place, turn, by_hand);
        clear_batch(batch_, bodies);
        return tables;
    }

private:
    EngineSettings ask_settings() const {
        const nb::object found = call(parameters_.ptr(), arguments_.ptr());
        EngineSettings now;
        now.dt_s = setting(found, 0), now.substeps = static_cast<int64_t>(setting(found, 1));
        for (int x = 0; x < 3; ++x) now.gravity_m_s2[x] = setting(found, 2 + x);
        return now;
    }
    int64_t take_read(Array<const LinkState, 1> earlier, Array<const LinkState, 1> later,
                      Array<const int64_t, 1> moved_bodies, bool hooked, double dt_s, const double (&gravity)[3],
                      double time_s) {
        loaded_.resize(reported_.size());
        const ReadStep read{viewed(reported_),
                            viewed(reported_before_),
                            viewed(loaded_before_),
                            earlier,
                            later,
                            moved_bodies,
                            hooked,
                            dt_s,
                            time_s};
        const StepCounts counts = add_step(read, gravity, traces_, {loaded_.data(), {count()}}, start_, batch_);
        if (counts.rows < 0) return counts.rows;
        loaded_.resize(static_cast<size_t>(counts.loaded));
        loaded_.swap(loaded_before_);
        return counts.rows;
    }
    template <class T>
    static int64_t size(const std::vector<T>& rows) {
        return static_cast<int64_t>(rows.size());
    }
    double setting(const nb::object& found, int which) const {
        PyObject* value = PyDict_GetItemWithError(found.ptr(), names_[which].ptr());
        if (value == nullptr) {
            if (PyErr_Occurred() != nullptr) nb::raise_python_error();
            throw nb::key_error("a setting of the engine");
        }
        const double number = PyFloat_AsDouble(value);
        if (number == -1.0 && PyErr_Occurred() != nullptr) nb::raise_python_error();
        return number;
    }
    void keep_fresh(bool stepped) {
        const bool same = fresh_.size() == reported_.size() &&
                          (fresh_.empty() ||
                           std::memcmp(fresh_.data(), reported_.data(), fresh_.size() * sizeof(ReportedContact)) == 0);
        if (!stepped && same) return;
        reported_before_.swap(reported_);
        reported_.swap(fresh_);
    }

    nb::object contacts_, parameters_;
    nb::tuple arguments_;
    nb::dict options_;
    nb::list names_;
    EngineSettings settings_;
    bool known_ = false;
    std::vector<ReportedContact> fresh_, reported_, reported_before_;
    std::vector<LoadedContact> loaded_, loaded_before_;
    TraceTables traces_{};
    Array<LinkStart, 1> start_{};
    nb::object start_owner_, owner_;
    StepBatch batch_;
    std::vector<LinkState> before_, now_;  // of usual steps: read before the last one, and before the one being made
    nb::object body_count_;
    int64_t bodies_ = 0, usual_ = 0;
    double time_s_ = 0;
};

void bind_step_reader(nb::module_& m) {
    add_dtype<WaitingStep>(m, "WAITING_STEP");
    nb::class_<StepReader>(m, "StepReader", "Asks one PyBullet client at each step, and keeps the steps that wait.")
        .def(nb::init<nb::object, nb::object, int64_t>(), "contacts"_a, "parameters"_a, "client_id"_a)
        .def("read_settings", &StepReader::read_settings, "Read the engine's settings; tell whether they changed.")
        .def_prop_ro("settings", &StepReader::settings, "Step length, sub-steps, gravity, as last read.")
        .def("poll", &StepReader::poll, "stepped"_a, "Ask for the contacts and keep those that carry a force.")
        .def("give", &StepReader::give, "rows"_a, "Take RAW rows in place of PyBullet's answer.")
        .def("forget_before", &StepReader::forget_before, "Take the last poll for the one before it, too.")
        .def_prop_ro("reported", &StepReader::reported, "RAW rows of the last poll.")
        .def_prop_ro("reported_before", &StepReader::reported_before, "RAW rows of the poll before it.")
        .def_prop_ro("count", &StepReader::count, "How many contacts the last poll found.")
        .def_prop_ro("loaded", &StepReader::loaded, "TOUCH rows of the step before.")
        .def("set_loaded", &StepReader::set_loaded, "rows"_a, "Set TOUCH rows of the step before.")
        .def("bind", &StepReader::bind, "traces"_a, "start"_a, "bodies"_a, "Take the tables of a roster.")
        .def("take", &StepReader::take, "earlier"_a, "later"_a, "moved_bodies"_a, "hooked"_a, "dt_s"_a,
             "gravity_m_s2"_a, "time_s"_a, "newest"_a,
             "Add the step that was read to those that wait: the number of its rows, or why it is not added.")
        .def_prop_ro("waiting", &StepReader::waiting, "How many steps wait.")
        .def_prop_ro("waiting_contacts", &StepReader::waiting_contacts, "How many contacts they have.")
        .def("expect_usual", &StepReader::expect_usual, "earlier"_a, "time_s"_a, "newest"_a, "body_count"_a, "bodies"_a,
             "Take steps as usual ones from now on, while nothing but the simulation itself changes.")
        .def("begin_usual", &StepReader::begin_usual, "states"_a,
             "Read what a usual step is taken from, before it is made; False where something is not as before.")
        .def("end_usual", &StepReader::end_usual,
             "Add the step just made to those that wait; below 0 where it is no usual one, its contacts asked for.")
        .def("usual_steps", &StepReader::usual_steps,
             "Return how many usual steps were added since it was last asked, the time after them, the trace's next\n"
             "table, and the states read before the last one.")
        .def_prop_ro("read_states", &StepReader::read_states, "States read before the step just made.")
        .def("taken", &StepReader::taken,
             "Return the steps that wait: WAITING_STEP and CONTACT rows; position, quaternion, moved by hand.");
}

void bind_dtypes(nb::module_& m) {
    add_dtype<LinkState>(m, "LINK_STATE");
    add_dtype<LinkStart>(m, "START");
    add_dtype<ReportedContact>(m, "RAW");
    add_dtype<LoadedContact>(m, "TOUCH");
    add_dtype<ContactTrace>(m, "TRACE");
    add_dtype<SoftImpact>(m, "SOFT_IMPACT");
    add_dtype<HeldPoint>(m, "HELD_POINT");
    add_dtype<PairLoad>(m, "PAIR_LOAD");
    m.attr("LINK_SPAN") = LINK_SPAN;
    m.attr("LEFT_OUT") = LEFT_OUT;
    m.attr("INVALID_BEYOND") = INVALID_BEYOND;
    m.attr("MEMORY_STEPS") = MEMORY_STEPS;
    m.attr("LONGEST_IMPACT_S") = LONGEST_IMPACT_S;
    m.attr("UNKNOWN_LINK") = UNKNOWN_LINK;
    m.attr("NEW_LINKS") = NEW_LINKS;
    m.attr("ABSURD_NUMBER") = ABSURD_NUMBER;
    m.attr("UNUSUAL_STEP") = UNUSUAL_STEP;
}

void bind_reading(nb::module_& m) {
    m.def("pack_contacts", &pack_contacts, "contacts"_a,
          "Make RAW rows of those of PyBullet's contacts that carry a force.");
    nb::class_<StateReader>(m, "StateReader", "Asks PyBullet for poses and twists of a roster's links.")
        .def(nb::init<nb::object, nb::object, nb::object, nb::object, nb::tuple, int64_t, bool>(), "joint_count"_a,
             "pose"_a, "twist"_a, "link_states"_a, "bodies"_a, "links"_a, "hooked"_a)
        .def("forget", &StateReader::forget, "Ask all bodies of mass 0 anew, as one of them may have been moved.")
        .def("read", &StateReader::read,
             "Return LINK_STATE rows, and 1 where all numbers are usable, 0 where not, -1 - place of a body that has\n"
             "other links.");
    m.def(
        "read_mujoco_motion",
        [](Array<const int64_t, 1> body, Array<const double, 2> centre_m, Array<const double, 2> orientation,
           Array<const double, 2> inertia_frame, Array<const double, 2> velocity, Array<const double, 2> tree_centre_m,
           Array<const int32_t, 1> root, Array<LinkState, 1> state) {
            const int64_t bodies = root.size();
            check_shape("centre_m", centre_m, bodies, 3);
            check_shape("orientation", orientation, bodies, 4);
            check_shape("inertia_frame", inertia_frame, bodies, 4);
            check_shape("velocity", velocity, bodies, 6);
            check_shape("tree_centre_m", tree_centre_m, bodies, 3);
            check_shape("state", state, body.size());
            for (int64_t i = 0; i < body.size(); ++i) check_range("body", body[i], 0, bodies);
            for (int64_t i = 0; i < bodies; ++i) check_range("root", root[i], 0, bodies);
            read_mujoco_motion(body, {centre_m, orientation, inertia_frame, velocity, tree_centre_m, root}, state);
        },
        "body"_a, "centre_m"_a, "orientation"_a, "inertia_frame"_a, "velocity"_a, "tree_centre_m"_a, "root"_a,
        "state"_a, "Fill states (n,) of the bodies of links (n,) from MuJoCo's tables; those of body 0 stay.");
    m.def(
        "load_contacts",
        [](Array<const ReportedContact, 1> reported, Array<const ReportedContact, 1> before, double dt_s,
           Array<LoadedContact, 1> loaded) {
            check_shape("loaded", loaded, reported.size());
            return load_contacts(reported, before, dt_s, loaded);
        },
        "reported"_a, "before"_a, "dt_s"_a, "loaded"_a,
        "Fill TOUCH rows from RAW rows and return how many are filled; before: reported after the step before.");
}

void bind_steps(nb::module_& m) {
    m.def(
        "begin_step",
        [](Array<const LinkState, 1> earlier, Array<const LinkState, 1> later, double dt_s,
           Array<const int64_t, 1> moved_bodies, bool hooked, Array<LinkStart, 1> start) {
            check_shape("earlier", earlier, start.size());
            check_shape("later", later, start.size());
            return begin_step(earlier, later, dt_s, moved_bodies, hooked, start);
        },
        "earlier"_a, "later"_a, "dt_s"_a, "moved_bodies"_a, "hooked"_a, "start"_a,
        "Fill START rows for a step; return how many links were moved by hand.");
    m.def(
        "make_contact_rows",
        [](Array<const LoadedContact, 1> loaded, Array<const LoadedContact, 1> before, Array<LinkStart, 1> start,
           double dt_s, double time_s, const TraceTables& traces, Array<Contact, 1> row) {
            check_traces(traces, loaded.size());
            check_order(traces);
            check_shape("row", row, loaded.size());
            return make_contact_rows(loaded, loaded.size(), before, start, dt_s, time_s, traces, row);
        },
        "loaded"_a, "before"_a, "start"_a, "dt_s"_a, "time_s"_a, "traces"_a, "row"_a,
        "Fill CONTACT rows and the newest trace; return the number of rows, or why there are none.");
    m.def(
        "place_bodies",
        [](Array<LinkStart, 1> start, Array<double, 2> position_m, Array<double, 2> quaternion_xyzw,
           Array<bool, 1> teleported) {
            const BodyPoses poses{position_m, quaternion_xyzw, teleported};
            check_poses(poses, start);
            place_bodies({start.data, {start.size()}}, poses);
        },
        "start"_a, "position_m"_a, "quaternion_xyzw"_a, "teleported"_a,
        "Write the poses of links that have an index, each to its row.");
}

}  // namespace

void bind_listener(nb::module_& m) {
    bind_dtypes(m);
    bind_reading(m);
    bind_steps(m);
    bind_step_reader(m);
    m.def(
        "rotation_between",
        [](Array<const double, 1> first, Array<const double, 1> second, Doubles vector_rad) {
            check_shape("first", first, 4);
            check_shape("second", second, 4);
            check_shape("vector_rad", vector_rad, 3);
            rotation_between(first.data, second.data, vector_rad.data);
        },
        "first"_a, "second"_a, "vector_rad"_a,
        "Write the rotation vector in rad, world frame, between two orientations xyzw.");
    m.def(
        "sort_pairs",
        [](Array<const Contact, 1> row, Array<ContactTrace, 1> trace, Array<int64_t, 2> sorting) {
            check_range("row", row.size(), 0, trace.size() + 1);
            check_range("row", row.size(), 0, sorting.shape[1] + 1);
            check_shape("sorting", sorting, 3, sorting.shape[1]);
            sort_pairs(row, row.size(), trace, sorting);
        },
        "row"_a, "trace"_a, "sorting"_a, "Write pair and order of traces: CONTACT rows by (a, b), stable.");
    m.def(
        "collect_rows",
        [](Array<const Contact, 1> row, Array<const double, 1> weight_n, double dt_s, double fall_m_s,
           const ImpactTables& tables) {
            const int64_t count = row.size();
            check_shape("weight_n", weight_n, count);
            check_shape("counts", tables.counts, 4);
            for (int64_t i = 0; i < 4; ++i) check_range("counts", tables.counts[i], 0, INT64_MAX);
            check_range("impacts", tables.counts[0] + count, 0, tables.impact.size() + 1);
            check_range("held", tables.counts[1] + count, 0, tables.held.size() + 1);
            check_range("pairs", tables.counts[2] + count, 0, tables.now.size() + 1);
            check_range("rows", tables.counts[3] + count + tables.held.size(), 0, tables.out.size() + 1);
            for (int64_t i = 0; i < tables.counts[1]; ++i) {  // each belongs to an impact
                bool known = false;
                for (int64_t j = 0; j < tables.counts[0] && !known; ++j)
                    known = tables.impact[j].key == tables.held[i].key;
                if (!known) throw nb::value_error("held: a point of no impact");
            }
            collect_rows(row, weight_n, dt_s, fall_m_s, tables);
        },
        "row"_a, "weight_n"_a, "dt_s"_a, "fall_m_s"_a, "tables"_a,
        "Collect the rows of a step's soft impacts: fill out; update impact, held, now and counts.");
}

}  // namespace engine
