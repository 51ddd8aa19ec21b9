// Python's door to src/listener, and PyBullet's answers -> rows: tuples are read here, where no object is made of them.
#include <cmath>

#include "../listener/kinematics.hpp"
#include "../listener/loaded_contacts.hpp"
#include "../listener/mujoco_motion.hpp"
#include "../listener/soft_impacts.hpp"
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

// An array of rows for Python, numbers not set.
template <class T, int N>
nb::object new_array(Array<T, N>& view, const int64_t (&shape)[N]) {
    npy_intp lengths[N];
    for (int axis = 0; axis < N; ++axis) lengths[axis] = shape[axis], view.shape[axis] = shape[axis];
    PyArray_Descr* dtype = nullptr;
    if constexpr (IsRow<T>::value) {
        dtype = dtype_slot<T>();
        Py_INCREF(reinterpret_cast<PyObject*>(dtype));
    } else {
        dtype = PyArray_DescrFromType(typenum<T>());
    }
    nb::object made = nb::steal(PyArray_Empty(N, lengths, dtype, 0));
    if (!made.is_valid()) nb::raise_python_error();
    view.data = static_cast<T*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(made.ptr())));
    return made;
}

// Tell whether one of PyBullet's contacts carries a force. NaN counts as a force, so that it is found. Bullet lists
// neighbours up to 2 cm apart too.
bool is_loaded(PyObject* contact) {
    if (!PyTuple_Check(contact)) throw nb::type_error("a contact that is no tuple");
    return !(number_at(contact, 9) == 0 && number_at(contact, 10) == 0 && number_at(contact, 12) == 0);
}

// Make rows of those of PyBullet's contacts that carry a force.
nb::object pack_contacts(nb::tuple contacts) {
    const auto count = static_cast<int64_t>(nb::len(contacts));
    int64_t loaded = 0;
    for (int64_t i = 0; i < count; ++i) loaded += is_loaded(PyTuple_GetItem(contacts.ptr(), i));
    Array<ReportedContact, 1> rows;
    nb::object packed = new_array(rows, {loaded});
    int64_t made = 0;
    for (int64_t i = 0; i < count; ++i) {
        PyObject* one = PyTuple_GetItem(contacts.ptr(), i);
        if (!is_loaded(one)) continue;
        ReportedContact& row = rows[made++];
        row.force_n = number_at(one, 9), row.friction_1_n = number_at(one, 10), row.friction_2_n = number_at(one, 12);
        row.body_a = index_at(one, 1), row.body_b = index_at(one, 2);
        row.link_a = index_at(one, 3), row.link_b = index_at(one, 4);
        numbers_at(one, 5, row.point_a_m), numbers_at(one, 6, row.point_b_m), numbers_at(one, 7, row.normal);
        row.gap_m = number_at(one, 8);
        numbers_at(one, 11, row.tangent_1), numbers_at(one, 13, row.tangent_2);
    }
    return packed;
}

// Ask PyBullet for its contacts: its answer, and rows of those that carry a force.
nb::tuple read_contacts(nb::object question, nb::dict options) {
    CollectorPause pause;
    const nb::tuple none;
    nb::object contacts = nb::steal(PyObject_Call(question.ptr(), none.ptr(), options.ptr()));
    if (!contacts.is_valid()) nb::raise_python_error();
    nb::object packed = pack_contacts(nb::tuple(contacts));
    return nb::make_tuple(contacts, packed);
}

nb::object call(PyObject* question, PyObject* arguments) {
    nb::object answer = nb::steal(PyObject_Call(question, arguments, nullptr));
    if (!answer.is_valid()) nb::raise_python_error();
    return answer;
}

// The functions that answer for a body, and their arguments.
struct Questions {
    nb::object joint_count, pose, twist, link_states;
};

// Make states (n,) of a roster's links; beside them, whether all numbers are within INVALID_BEYOND. bodies: of each,
// the arguments of the first three questions, its joints, whether its mass is 0, and the arguments of the last one. A
// body that has another number of joints than before is another, which has taken over its id: asking it for a link that
// is not there would end the process. The body's place is returned instead, as -1 − place.
nb::tuple read_states(const Questions& ask, nb::tuple bodies, int64_t links) {
    Array<LinkState, 1> states;
    const nb::object table = new_array(states, {links});
    CollectorPause pause;
    int64_t row = 0, place = 0;
    for (nb::handle entry : bodies) {
        PyObject* body = entry.ptr();
        PyObject* arguments = PyTuple_GetItem(body, 0);
        const int64_t joints = index_at(body, 1), fixed = index_at(body, 2);
        check_range("states", row + joints, 0, states.size());
        const nb::object count = call(ask.joint_count.ptr(), arguments);
        if (PyLong_AsLongLong(count.ptr()) != joints) return nb::make_tuple(table, -1 - place);
        const nb::object pose = call(ask.pose.ptr(), arguments);
        LinkState& base = states[row++];
        base = {};
        numbers_at(pose.ptr(), 0, base.position_m), numbers_at(pose.ptr(), 1, base.quaternion_xyzw);
        if (fixed == 0) {
            const nb::object twist = call(ask.twist.ptr(), arguments);
            numbers_at(twist.ptr(), 0, base.velocity_m_s), numbers_at(twist.ptr(), 1, base.spin_rad_s);
        }
        ++place;
        if (joints == 0) continue;
        const nb::object answer = call(ask.link_states.ptr(), PyTuple_GetItem(body, 3));
        for (int64_t i = 0; i < joints; ++i) {
            PyObject* link = PyTuple_GetItem(answer.ptr(), i);
            if (link == nullptr) nb::raise_python_error();
            LinkState& state = states[row++];
            numbers_at(link, 0, state.position_m), numbers_at(link, 1, state.quaternion_xyzw);
            numbers_at(link, 6, state.velocity_m_s), numbers_at(link, 7, state.spin_rad_s);
        }
    }
    check_range("states", row, states.size(), states.size() + 1);
    constexpr int64_t numbers = sizeof(LinkState) / sizeof(double);
    const auto* number = reinterpret_cast<const double*>(states.data);
    for (int64_t i = 0; i < states.size() * numbers; ++i)
        if (!(std::fabs(number[i]) < INVALID_BEYOND)) return nb::make_tuple(table, 0);
    return nb::make_tuple(table, 1);
}

void check_traces(const TraceTables& traces, int64_t contacts) {
    const int64_t capacity = traces.table.shape[1];
    check_shape("traces' table", traces.table, MEMORY_STEPS + 1, capacity);
    check_shape("traces' count", traces.count, MEMORY_STEPS + 1);
    check_shape("traces' sorting", traces.sorting, 2, 2, capacity);
    check_range("contacts", contacts, 0, capacity + 1);
    check_range("newest", traces.newest, 0, MEMORY_STEPS + 1);
    for (int64_t i = 0; i <= MEMORY_STEPS; ++i) check_range("traces' count", traces.count[i], 0, capacity + 1);
}

void check_poses(const BodyPoses& poses, Array<LinkStart, 1> start) {
    const int64_t bodies = poses.teleported.size();
    check_shape("position_m", poses.position_m, bodies, 3);
    check_shape("quaternion_xyzw", poses.quaternion_xyzw, bodies, 4);
    for (int64_t i = 0; i < start.size(); ++i)
        if (start[i].index >= 0) check_range("pose", start[i].pose, 0, bodies);
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
    m.def("read_contacts", &read_contacts, "question"_a, "options"_a,
          "Ask PyBullet for its contacts: its answer, and RAW rows of those that carry a force.");
    m.def(
        "read_states",
        [](nb::object joint_count, nb::object pose, nb::object twist, nb::object link_states, nb::tuple bodies,
           int64_t links) { return read_states({joint_count, pose, twist, link_states}, bodies, links); },
        "joint_count"_a, "pose"_a, "twist"_a, "link_states"_a, "bodies"_a, "links"_a,
        "Ask PyBullet for poses and twists of bodies (arguments, joints, fixed, arguments of the links): LINK_STATE\n"
        "rows, and 1 where all numbers are usable, 0 where not, -1 - place of a body that has other links.");
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
    m.def(
        "take_step",
        [](Array<const ReportedContact, 1> reported, Array<const ReportedContact, 1> reported_before,
           Array<const LoadedContact, 1> before, Array<const LinkState, 1> earlier, Array<const LinkState, 1> later,
           Array<const int64_t, 1> moved_bodies, bool hooked, double dt_s, double time_s, const TraceTables& traces,
           Array<LinkStart, 1> start, int64_t bodies) {
            const int64_t count = reported.size();
            StepTables made;
            made.start = start;
            nb::object loaded = new_array(made.loaded, {count}), row = new_array(made.row, {count});
            nb::object position_m = new_array(made.poses.position_m, {bodies, 3}),
                       quaternion_xyzw = new_array(made.poses.quaternion_xyzw, {bodies, 4}),
                       teleported = new_array(made.poses.teleported, {bodies});
            check_traces(traces, count);
            check_shape("earlier", earlier, start.size());
            check_shape("later", later, start.size());
            check_poses(made.poses, start);
            const StepCounts counts = take_step(
                {reported, reported_before, before, earlier, later, moved_bodies, hooked, dt_s, time_s}, traces, made);
            return nb::make_tuple(counts.loaded, counts.rows, loaded, row, position_m, quaternion_xyzw, teleported);
        },
        "reported"_a, "reported_before"_a, "before"_a, "earlier"_a, "later"_a, "moved_bodies"_a, "hooked"_a, "dt_s"_a,
        "time_s"_a, "traces"_a, "start"_a, "bodies"_a,
        "Make a step of an unchanged roster: how many contacts and rows it has, or why it has none; these; and the\n"
        "poses of so many bodies: position, quaternion, moved by hand.");
}

}  // namespace

void bind_listener(nb::module_& m) {
    bind_dtypes(m);
    bind_reading(m);
    bind_steps(m);
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
        [](Array<const Contact, 1> row, Array<ContactTrace, 1> trace, Array<int64_t, 3> sorting) {
            check_range("row", row.size(), 0, trace.size() + 1);
            check_range("row", row.size(), 0, sorting.shape[2] + 1);
            check_shape("sorting", sorting, 2, 2, sorting.shape[2]);
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
