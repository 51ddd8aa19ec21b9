#include "step_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "kinematics.hpp"
#include "loaded_contacts.hpp"
#include "step_start.hpp"

namespace engine {

namespace {

constexpr double SPAWN_DEPTH_M = 1e-4;  // a new body may lie so deep in its partner without being created inside it

// The row of a code, or -1.
int64_t find_link(Array<const LinkStart, 1> start, int64_t code) {
    const auto is_before = [](const LinkStart& one, int64_t other) { return one.code < other; };
    const int64_t at = std::lower_bound(start.data, start.data + start.size(), code, is_before) - start.data;
    return at < start.size() && start[at].code == code ? at : -1;
}

bool rests(const LinkStart& link) {
    const double *v = link.velocity_m_s, *w = link.spin_rad_s;
    return v[0] == 0 && v[1] == 0 && v[2] == 0 && w[0] == 0 && w[1] == 0 && w[2] == 0;
}

// Tell whether a contact is one of those before, to the bit. at: its number.
bool was_there(const LoadedContact& row, int64_t at, Array<const LoadedContact, 1> before) {
    const int64_t count = before.size();
    for (int64_t j = 0; j < count; ++j) {
        const LoadedContact& old = before[(at + j) % count];
        if (std::equal(row.point_a_m, row.point_a_m + 3, old.point_a_m) &&
            std::equal(row.impulse_n_s, row.impulse_n_s + 3, old.impulse_n_s) && old.code_a == row.code_a &&
            old.code_b == row.code_b)
            return true;
    }
    return false;
}

bool counts(const LoadedContact& row, int64_t at, Array<const LoadedContact, 1> before, const LinkStart& a,
            const LinkStart& b, double approach_m_s, double dt_s) {
    if (a.moved || b.moved) return false;
    if (rests(a) && rests(b) && was_there(row, at, before)) return false;
    const bool inside = row.gap_m < -(SPAWN_DEPTH_M + std::max(approach_m_s, 0.0) * dt_s);
    return !(inside && (a.born || b.born));
}

bool is_fine(double number) {
    return std::fabs(number) <= LARGEST_SI;
}  // false for NaN too

// Fill a row except its bodies and sweep; tell whether all numbers are fine.
bool fill(const LoadedContact& contact, const ContactTrace& fresh, const double slip_m_s[3], double approach_m_s,
          Contact& row) {
    row.approach_m_s = approach_m_s;
    row.gap_m = contact.gap_m + std::max(approach_m_s, 0.0) * contact.elapsed_s;
    bool fine = is_fine(approach_m_s) && is_fine(row.gap_m) && is_fine(row.sweep_m_s[0]) && is_fine(row.sweep_m_s[1]);
    for (int x = 0; x < 3; ++x) {
        row.point_a_m[x] = fresh.point_a_m[x], row.point_b_m[x] = fresh.point_b_m[x];
        row.normal[x] = contact.normal[x], row.impulse_n_s[x] = contact.impulse_n_s[x], row.slip_m_s[x] = slip_m_s[x];
        fine = fine && is_fine(fresh.point_a_m[x]) && is_fine(fresh.point_b_m[x]) && is_fine(slip_m_s[x]);
    }
    return fine;
}

}  // namespace

int64_t make_contact_rows(Array<const LoadedContact, 1> loaded, int64_t count, Array<const LoadedContact, 1> before,
                          Array<LinkStart, 1> start, double dt_s, double time_s, const TraceTables& traces,
                          Array<Contact, 1> row) {
    const Array<const LinkStart, 1> links{start.data, {start.size()}};
    const Array<ContactTrace, 1> trace = traces.table[traces.newest];
    int64_t made = 0;
    bool strangers = false, fine = true;
    for (int64_t i = 0; i < count; ++i) {
        const LoadedContact& contact = loaded[i];
        const int64_t at_a = find_link(links, contact.code_a), at_b = find_link(links, contact.code_b);
        if (at_a < 0 || at_b < 0) return UNKNOWN_LINK;
        LinkStart &a = start[at_a], &b = start[at_b];
        double slip_m_s[3];
        const double approach_m_s = relative_motion(contact, a, b, slip_m_s);
        if (!counts(contact, i, before, a, b, approach_m_s, dt_s)) continue;
        if (a.index < 0 || b.index < 0) {
            if (std::min(a.index, b.index) > LEFT_OUT) {
                a.met = a.index < 0, b.met = b.index < 0;
                strangers = true;
            }
            continue;
        }
        ContactTrace& fresh = trace[made];
        Contact& out = row[made];
        fresh.time_s = time_s + contact.elapsed_s;
        out.a = static_cast<int32_t>(a.index), out.b = static_cast<int32_t>(b.index);
        sweep_surfaces(contact, a, b, pair_key(a.index, b.index), slip_m_s, traces, fresh, out.sweep_m_s);
        fine = fill(contact, fresh, slip_m_s, approach_m_s, out) && fine;
        ++made;
    }
    if (strangers) return NEW_LINKS;
    if (!fine) return ABSURD_NUMBER;
    sort_pairs({row.data, {row.size()}}, made, trace, traces.sorting);
    traces.count[traces.newest] = made;
    return made;
}

void place_bodies(Array<const LinkStart, 1> start, const BodyPoses& poses) {
    for (int64_t i = 0; i < start.size(); ++i) {
        const LinkStart& link = start[i];
        if (link.index < 0) continue;
        for (int x = 0; x < 3; ++x) poses.position_m(link.pose, x) = link.position_m[x];
        for (int x = 0; x < 4; ++x) poses.quaternion_xyzw(link.pose, x) = link.quaternion_xyzw[x];
        poses.teleported[link.pose] = link.moved != 0;
    }
}

StepCounts take_step(const ReadStep& read, const TraceTables& traces, const StepTables& made) {
    const int64_t count = load_contacts(read.reported, read.reported_before, read.dt_s, made.loaded);
    const Array<const LoadedContact, 1> loaded{made.loaded.data, {made.loaded.size()}};
    if (!are_usable(loaded, count) || (!read.hooked && is_unmoved(read.earlier, read.later)))
        return {count, UNUSUAL_STEP};
    const int64_t moved = begin_step(read.earlier, read.later, read.dt_s, read.moved_bodies, read.hooked, made.start);
    if (moved > 0 && !read.hooked) return {count, UNUSUAL_STEP};
    const int64_t rows =
        make_contact_rows(loaded, count, read.before, made.start, read.dt_s, read.time_s, traces, made.row);
    if (rows >= 0) place_bodies({made.start.data, {made.start.size()}}, made.poses);
    return {count, rows};
}

}  // namespace engine
