#include "contact_rows.hpp"

#include <algorithm>

#include "../math/rotation.hpp"
#include "../math/stable_order.hpp"
#include "load_splitting.hpp"

namespace engine {

// Fill a row but for its key.
static void turn_contact(const Contact& contact, Array<const double, 2> quaternion_xyzw, ContactRow& row) {
    const bool swapped = contact.a > contact.b;
    const double onto_lower = swapped ? -1.0 : 1.0;
    double load_n_s = 0.0;
    for (int x = 0; x < 3; ++x) {
        row.impulse_n_s[x] = onto_lower * contact.impulse_n_s[x];
        row.normal[x] = onto_lower * contact.normal[x];
        load_n_s += contact.impulse_n_s[x] * contact.normal[x];
    }
    row.load_n_s = std::max(load_n_s, 0.0);
    row.approach_m_s = contact.approach_m_s, row.gap_m = contact.gap_m, row.touched = 0;
    for (int side = 0; side < 2; ++side) {
        const bool is_a = (side == 1) == swapped;
        const double sign = is_a ? 1.0 : -1.0;  // the contact acts on a and points to it
        const double (&point_m)[3] = is_a ? contact.point_a_m : contact.point_b_m;
        row.body[side] = is_a ? contact.a : contact.b;
        row.sweep_m_s[side] = contact.sweep_m_s[is_a ? 0 : 1];
        double turn[3][3];
        fill_rotation(quaternion_xyzw[row.body[side]].data, turn);
        for (int x = 0; x < 3; ++x) {
            double arm_m = 0.0, outward = 0.0, local_impulse_n_s = 0.0;
            for (int y = 0; y < 3; ++y) {
                arm_m += turn[x][y] * point_m[y];
                outward -= turn[y][x] * (sign * contact.normal[y]);
                local_impulse_n_s += turn[y][x] * (sign * contact.impulse_n_s[y]);
            }
            row.point_m[side][x] = point_m[x], row.arm_m[side][x] = arm_m;
            row.outward[side][x] = outward, row.local_impulse_n_s[side][x] = local_impulse_n_s;
        }
    }
}

void orient(Array<const Contact, 1> contacts, Array<const double, 2> quaternion_xyzw, Array<ContactRow, 1> rows,
            ContactScratch& memory) {
    const int64_t count = contacts.size();
    Integers key = room(memory.key, count), order = room(memory.order, count), other = room(memory.other, count);
    for (int64_t i = 0; i < count; ++i) {
        const int64_t a = contacts[i].a, b = contacts[i].b;
        key[i] = pair_key(std::min(a, b), std::max(a, b));
    }
    order = stable_order(key, order, other);
    for (int64_t i = 0; i < count; ++i) {
        rows[i].key = key[order[i]];
        turn_contact(contacts[order[i]], quaternion_xyzw, rows[i]);
    }
}

// Reset a place for the pair of a row: no load so far, no friction.
static void begin_pair(Pair& pair, const ContactRow& row) {
    pair.key = row.key;
    pair.rubs = 0, pair.gains = 0, pair.load_n = 0.0;
    for (int side = 0; side < 2; ++side) pair.body[side] = row.body[side], pair.sweep_m_s[side] = 0.0;
    for (int x = 0; x < 3; ++x) pair.direction[x] = 0.0;
    for (int column = 0; column < HISTORY; ++column) pair.force_n[column] = pair.struck_n[column] = 0.0;
}

void enter_loads(Array<const ContactRow, 1> rows, int64_t start, int64_t stop, double dt_s, const PairTables& pairs,
                 ContactScratch& memory) {
    const auto& [table, active, count, free, gain, patch] = pairs;
    Integers merged = room(memory.merged, count[0] + stop - start);
    int64_t i = 0, r = start, kept = 0;
    while (i < count[0] || r < stop) {  // pairs of both lists, by key
        int64_t place;
        if (r < stop && (i == count[0] || rows[r].key < table[active[i]].key)) {
            place = free[--count[1]];
            begin_pair(table[place], rows[r]);
        } else {
            place = active[i++];
        }
        Pair& pair = table[place];
        bool stays = pair.rubs != 0;
        for (int column = 1; column < HISTORY; ++column) {
            pair.force_n[column - 1] = pair.force_n[column];
            pair.struck_n[column - 1] = pair.struck_n[column];
            stays = stays || pair.force_n[column] > 0.0;
        }
        double load_n_s = 0.0;
        while (r < stop && rows[r].key == pair.key) load_n_s += rows[r++].load_n_s;
        pair.force_n[HISTORY - 1] = load_n_s / dt_s, pair.struck_n[HISTORY - 1] = 0.0;
        if (stays || load_n_s > 0.0) {
            for (int end = 0; end < 2; ++end) pair.support_n[end] = opening(pair.force_n, NOW + end);
            merged[kept++] = place;
        } else {
            free[count[1]++] = place;
        }
    }
    count[0] = kept;
    for (i = 0; i < kept; ++i) active[i] = merged[i];
}

}  // namespace engine
