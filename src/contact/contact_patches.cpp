#include "contact_patches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "../math/elementary.hpp"
#include "load_splitting.hpp"

namespace engine {

using Sides = double[2][3];  // a vector in either body's frame

constexpr double ENDLESS = std::numeric_limits<double>::infinity();

static void copy_sides(const Sides& from, Sides& to) {
    for (int side = 0; side < 2; ++side)
        for (int x = 0; x < 3; ++x) to[side][x] = from[side][x];
}

static double length_of(const double (&vector)[3]) {
    return std::sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]);
}

// What a step's rows add to a patch.
struct PatchStep {
    double load_n[PATCH_POINTS];     // of each tracked point
    Sides moment_n_m[PATCH_POINTS];  // of its rows' points
    Sides outward_n;                 // sum of the rows' normals, by their loads
    double total_n;
};

struct NearPoint {
    int64_t point;
    double distance_m;
};

// Find the tracked point nearest to a row's, by the body on which it moved less.
static NearPoint nearest_tracked(const ContactPatch& patch, const Sides& point_m) {
    int64_t best = 0;
    double least_m2 = ENDLESS;
    for (int64_t k = 0; k < patch.count; ++k) {
        for (int side = 0; side < 2; ++side) {
            double square_m2 = 0.0;
            for (int x = 0; x < 3; ++x) {
                const double off_m = patch.point_m[k][side][x] - point_m[side][x];
                square_m2 += off_m * off_m;
            }
            if (square_m2 < least_m2) best = k, least_m2 = square_m2;
        }
    }
    return {best, std::sqrt(least_m2)};
}

// Assign each row to the tracked point near it, or to a new one. per_s: newtons per N·s of a row's load.
static void assign_rows(ContactPatch& patch, Array<const ContactRow, 1> rows, double per_s, double near_m,
                        PatchStep& step) {
    step = {};
    const int64_t old = patch.count;
    double most_n = 0.0;
    for (int64_t r = 0; r < rows.size(); ++r) {
        const ContactRow& row = rows[r];
        const double load_n = row.load_n_s * per_s;
        if (load_n <= 0.0) continue;
        auto [k, distance_m] = nearest_tracked(patch, row.point_m);
        if (distance_m > near_m && patch.count < PATCH_POINTS) {
            k = patch.count++;
            patch.load_n[k] = 0.0;
            copy_sides(row.point_m, patch.point_m[k]);
        }
        step.load_n[k] += load_n;
        step.total_n += load_n;
        if (old == 0 && load_n > most_n) {  // a new pair takes its heaviest row's normal, then the mean
            most_n = load_n;
            copy_sides(row.outward, patch.outward);
        }
        for (int side = 0; side < 2; ++side) {
            for (int x = 0; x < 3; ++x) {
                step.moment_n_m[k][side][x] += load_n * row.point_m[side][x];
                step.outward_n[side][x] += load_n * row.outward[side][x];
            }
        }
    }
}

// Smooth the pair's normals towards those of a step. Where these press from opposite sides and cancel, they stay.
static void smooth_normals(ContactPatch& patch, const PatchStep& step, double follow) {
    for (int side = 0; side < 2; ++side) {
        const double length_n = length_of(step.outward_n[side]);
        double (&mean)[3] = patch.outward[side];
        if (length_n < LEAST_PATCH * step.total_n) continue;
        for (int x = 0; x < 3; ++x) mean[x] += follow * (step.outward_n[side][x] / length_n - mean[x]);
        const double length = std::max(length_of(mean), 1e-300);
        for (double& x : mean) x /= length;
    }
}

// Update the tracked points by a pair's rows, whose loads in N·s times per_s are newtons.
static void smooth_patch(ContactPatch& patch, Array<const ContactRow, 1> rows, double per_s, double near_m,
                         double follow) {
    constexpr double least_n = 1e-9;  // newtons below which nothing is carried
    const int64_t old = patch.count;
    PatchStep step;
    assign_rows(patch, rows, per_s, near_m, step);
    if (step.total_n > 0.0) smooth_normals(patch, step, old ? follow : 1.0);
    double whole_n = 0.0;
    for (int64_t k = 0; k < patch.count; ++k) {
        patch.load_n[k] += follow * (step.load_n[k] - patch.load_n[k]);
        whole_n += patch.load_n[k];
        if (!(step.load_n[k] > 0.0)) continue;
        // its position enters with its added load, so that the moment is smoothed as the load is
        const double weight = follow * step.load_n[k] / patch.load_n[k];
        for (int side = 0; side < 2; ++side)
            for (int x = 0; x < 3; ++x)
                patch.point_m[k][side][x] +=
                    weight * (step.moment_n_m[k][side][x] / step.load_n[k] - patch.point_m[k][side][x]);
    }
    int64_t kept = 0;
    for (int64_t k = 0; k < patch.count; ++k) {
        if (patch.load_n[k] >= std::max(LEAST_PATCH * whole_n, least_n) || step.load_n[k] > 0.0) {
            patch.load_n[kept] = patch.load_n[k];
            if (kept < k) copy_sides(patch.point_m[k], patch.point_m[kept]);
            ++kept;
        }
    }
    patch.count = kept;
}

// Return whether points or loads differ from those that the present poles were computed for.
static bool differs(const ContactPatch& patch, double near_m) {
    // factors by which a load must differ from the one of the present poles before new ones are computed: at once, 17 %
    // of a Hertz spring, and after rest_s, 3 %
    constexpr double far_off = 1.6, off_at_rest = 1.1, rest_s = 0.2;
    if (patch.count != patch.used) return true;
    const double off = patch.used_s > rest_s ? off_at_rest : far_off;
    for (int64_t k = 0; k < patch.count; ++k) {
        if (!(patch.used_n[k] / off <= patch.load_n[k] && patch.load_n[k] <= patch.used_n[k] * off)) return true;
        for (int side = 0; side < 2; ++side) {
            double square_m2 = 0.0;
            for (int x = 0; x < 3; ++x) {
                const double off_m = patch.point_m[k][side][x] - patch.used_m[k][side][x];
                square_m2 += off_m * off_m;
            }
            if (std::sqrt(square_m2) > near_m) return true;
        }
    }
    return false;
}

static void mark_stale(const Pair& pair, Array<SupportState, 1> support_state) {
    for (int64_t b : pair.body) support_state[b].stale = 1;
}

static void release_patch(ContactPatch& patch, const Pair& pair, Array<SupportState, 1> support_state) {
    if (patch.used) mark_stale(pair, support_state);
    patch.count = patch.used = 0;
    patch.used_s = 0.0;
}

void track_contact_patches(const Window& here, Array<const ContactRow, 1> rows, const BodyTables& table,
                           const PairTables& pairs, Array<SupportState, 1> support_state) {
    constexpr double same_point =
        0.15;  // of the smaller body's size: rows nearer to a tracked point are the same point
    // time constant of loads: of 20 to 50 ms, seven steps at 240 Hz, within which each corner of a box is loaded
    constexpr double smooth_s = 0.03;
    const double follow = 1.0 - engine::exp(-here.dt_s / smooth_s);
    int64_t row = here.row[0];
    const int64_t stop = here.row[1];
    for (int64_t i = 0; i < pairs.count[0]; ++i) {
        const int64_t slot = pairs.active[i];
        const Pair& pair = pairs.pair[slot];
        ContactPatch& patch = pairs.patch[slot];
        while (row < stop && rows[row].key < pair.key) ++row;
        const int64_t begin = row;
        while (row < stop && rows[row].key == pair.key) ++row;
        if (patch.count == 0 && !(pair.support_n[0] > 0.0)) continue;
        bool touches = false;
        for (int column = NOW; column < NOW + SPAN; ++column) touches = touches || pair.force_n[column] > 0.0;
        if (!touches) {
            release_patch(patch, pair, support_state);
            continue;
        }
        double size_m = ENDLESS;
        for (int64_t b : pair.body)
            if (table.bodies[b].volume_m3 > 0.0) size_m = std::min(size_m, table.bodies[b].size_m);
        const double near_m = size_m < ENDLESS ? same_point * size_m : ENDLESS;
        const double per_s =
            pair.force_n[NOW] > 0.0 ? std::min(pair.support_n[0] / pair.force_n[NOW], 1.0) / here.dt_s : 0.0;
        smooth_patch(patch, rows.part(begin, row), per_s, near_m, follow);
        patch.used_s += here.dt_s;
        if (differs(patch, near_m)) {
            patch.used = patch.count, patch.used_s = 0.0;
            for (int64_t k = 0; k < patch.count; ++k) {
                patch.used_n[k] = patch.load_n[k];
                copy_sides(patch.point_m[k], patch.used_m[k]);
            }
            mark_stale(pair, support_state);
        }
    }
}

void count_separations(Array<SupportState, 1> support_state, const RingingModes& modes) {
    const double* separation = modes.law + 6 * modes.lanes;
    for (int64_t b = 0; b < support_state.size(); ++b) {
        SupportState& state = support_state[b];
        if (!state.points || !(modes.ringing[b].ringing || modes.ringing[b].driven)) continue;
        double total = 0.0;
        for (int64_t m = modes.body[b].start; m < modes.body[b].stop; ++m) {
            if (!(separation[m] > 0.0)) continue;
            const double x = modes.z[m] + modes.driven[m];
            const double y = modes.z[modes.lanes + m] + modes.driven[modes.lanes + m];
            total += separation[m] * std::sqrt(x * x + y * y);
        }
        ++state.steps;
        state.separated += total > 1.0;
    }
}

// Choose the next of those that wait: of moving bodies, the one stale longest, then of fixed ones; -1 for none.
static int64_t longest_stale(Array<const SupportState, 1> support_state, Array<const Body, 1> bodies,
                             Array<const int64_t, 1> waiting) {
    int64_t best = -1;
    for (int64_t b = 0; b < support_state.size(); ++b) {
        if (!waiting[b]) continue;
        if (best < 0) {
            best = b;
            continue;
        }
        const bool fixed = bodies[b].mass_kg <= 0.0, best_fixed = bodies[best].mass_kg <= 0.0;
        if ((best_fixed && !fixed) || (fixed == best_fixed && support_state[b].stale_s > support_state[best].stale_s))
            best = b;
    }
    return best;
}

// Estimate the cost of new poles, in s of a processor of 2025, from their counts: the same on every machine.
static double pole_cost_s(int64_t modes, int64_t points) {
    const double order = static_cast<double>(modes + 6);
    return 1.25e-4 + 3.75e-5 * points + 5e-8 * (order * order);
}

int64_t choose_bodies(double dt_s, const BodyTables& table, const PairTables& pairs, const SupportTables& supports,
                      const Ringing* ringing, const ScratchTables& scratch, ContactScratch& memory) {
    constexpr double again_s = 0.02;  // a body's poles stay at least so long, four blocks of the bank
    // fraction of simulated time that may go into new poles: live sound is never late for it. The body that waits
    // longest is served first, moving ones before fixed ones. All that can be are served in one step: that the second
    // of two bodies that meet has its poles a step later is heard, 1.3 dB of the table-top's level over 50 ms.
    constexpr double pole_fraction = 0.015;
    const Array<SupportState, 1> support_state = supports.support_state;
    const Array<const Body, 1> bodies = table.bodies;
    const int64_t count = support_state.size();
    double& credit_s = supports.credit_s[0];
    credit_s = std::min(credit_s + pole_fraction * dt_s, SAVED_S);
    bool some = false;
    for (int64_t b = 0; b < count; ++b) {
        SupportState& state = support_state[b];
        state.wait_s = std::max(state.wait_s - dt_s, 0.0);
        if (!state.stale) continue;
        state.stale_s += dt_s;
        some = some || (state.wait_s == 0.0 && bodies[b].modes > 0);
    }
    if (!some || credit_s <= 0.0) return 0;
    Integers waiting = room(memory.waiting, count), points = room(memory.points, count);
    for (int64_t b = 0; b < count; ++b) waiting[b] = points[b] = 0;
    for (int side = 0; side < 2; ++side) {
        for (int64_t i = 0; i < scratch.count[0]; ++i) waiting[scratch.pulse[i].body[side]] = 1;
        for (int64_t i = 0; i < scratch.count[1]; ++i) waiting[scratch.body(i, side)] = 1;
        for (int64_t i = 0; i < pairs.count[0]; ++i)
            points[pairs.pair[pairs.active[i]].body[side]] += pairs.patch[pairs.active[i]].count;
    }
    for (int64_t b = 0; b < count; ++b) {
        const Ringing& now = ringing[b];
        const bool active = waiting[b] || now.ringing || now.driven || now.tiled || now.strike >= 0;
        waiting[b] = active && support_state[b].stale && support_state[b].wait_s == 0.0 && bodies[b].modes > 0;
    }
    int64_t wanted = 0;
    while (credit_s > 0.0) {
        const int64_t best = longest_stale(support_state, bodies, waiting);
        if (best < 0) break;
        SupportState& state = support_state[best];
        waiting[best] = 0, state.stale = 0, state.wanted = 1;
        state.stale_s = 0.0, state.wait_s = again_s, state.points = points[best];
        if (points[best]) credit_s -= pole_cost_s(bodies[best].modes, points[best]);  // its free poles are known
        ++wanted;
    }
    return wanted;
}

}  // namespace engine
