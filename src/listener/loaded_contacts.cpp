#include "loaded_contacts.hpp"

#include <algorithm>
#include <cmath>

namespace engine {

namespace {

// Tell whether a contact without normal force has the friction of its row before, to the bit. at: its number; Bullet
// reports contacts in nearly the same order again.
bool is_stale(const ReportedContact& row, int64_t at, Array<const ReportedContact, 1> before) {
    const int64_t count = before.size();
    for (int64_t j = 0; j < count; ++j) {
        const ReportedContact& old = before[(at + j) % count];
        if (old.friction_1_n == row.friction_1_n && old.friction_2_n == row.friction_2_n && old.body_a == row.body_a &&
            old.body_b == row.body_b && old.link_a == row.link_a && old.link_b == row.link_b)
            return true;
    }
    return false;
}

}  // namespace

int64_t load_contacts(Array<const ReportedContact, 1> reported, Array<const ReportedContact, 1> before, double dt_s,
                      Array<LoadedContact, 1> loaded) {
    int64_t count = 0;
    for (int64_t i = 0; i < reported.size(); ++i) {
        const ReportedContact& row = reported[i];
        if (row.force_n == 0 && is_stale(row, i, before)) continue;
        LoadedContact& made = loaded[count++];
        made.code_a = row.body_a * LINK_SPAN + row.link_a + 1;
        made.code_b = row.body_b * LINK_SPAN + row.link_b + 1;
        made.gap_m = row.gap_m, made.elapsed_s = 0;
        std::copy(row.point_a_m, row.point_a_m + 3, made.point_a_m);
        std::copy(row.point_b_m, row.point_b_m + 3, made.point_b_m);
        std::copy(row.normal, row.normal + 3, made.normal);
        for (int x = 0; x < 3; ++x)
            made.impulse_n_s[x] = dt_s * (row.force_n * row.normal[x] + row.friction_1_n * row.tangent_1[x] +
                                          row.friction_2_n * row.tangent_2[x]);
    }
    return count;
}

bool are_usable(Array<const LoadedContact, 1> loaded, int64_t count) {
    for (int64_t i = 0; i < count; ++i) {
        const LoadedContact& row = loaded[i];
        bool usable = std::fabs(row.gap_m) < INVALID_BEYOND;
        for (int x = 0; x < 3; ++x)
            usable = usable && std::fabs(row.point_a_m[x]) < INVALID_BEYOND &&
                     std::fabs(row.point_b_m[x]) < INVALID_BEYOND && std::fabs(row.normal[x]) < INVALID_BEYOND &&
                     std::fabs(row.impulse_n_s[x]) < INVALID_BEYOND;
        if (!usable) return false;
    }
    return true;
}

}  // namespace engine
