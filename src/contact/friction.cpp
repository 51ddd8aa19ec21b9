#include "friction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "../math/elementary.hpp"
#include "contact_oscillator.hpp"
#include "contact_place.hpp"
#include "hertz.hpp"
#include "load_splitting.hpp"
#include "octave_heights.hpp"
#include "strike_forces.hpp"

namespace engine {

// Set a voice's sweep and direction at the step's end, its rows and their load, from its pair's rows begin … end - 1.
// No rows where the manifold does not carry load.
static void aim_voice(Array<const ContactRow, 1> rows, int64_t begin, int64_t end, Voice& voice) {
    double total_n_s = 0.0, along_n_s[3] = {}, sweep[2] = {};
    for (int64_t r = begin; r < end; ++r) {
        const ContactRow& row = rows[r];
        total_n_s += row.load_n_s;
        for (int axis = 0; axis < 3; ++axis) along_n_s[axis] += row.impulse_n_s[axis];
        for (int side = 0; side < 2; ++side) sweep[side] += row.load_n_s * row.sweep_m_s[side];
    }
    const double pull_n_s =
        std::sqrt(along_n_s[0] * along_n_s[0] + along_n_s[1] * along_n_s[1] + along_n_s[2] * along_n_s[2]);
    const bool carries = total_n_s > 0.0 && total_n_s * STEEPEST >= pull_n_s;
    voice.begin = begin, voice.end = carries ? end : begin, voice.total_n_s = total_n_s;
    const double divisor_n_s = carries ? total_n_s : std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) voice.direction[1][axis] = along_n_s[axis] / divisor_n_s;
    for (int side = 0; side < 2; ++side) {
        double mean_m_s = sweep[side] / divisor_n_s;
        mean_m_s = mean_m_s < SWEEP_FLOOR_M_S ? 0.0 : mean_m_s;
        voice.sweep_m_s[1][side] = mean_m_s > FASTEST_M_S ? FASTEST_M_S : mean_m_s;
    }
}

// Advance a pair to the step's end by its voice; return whether the voice moves.
static bool advance_pair(Pair& pair, Voice& voice, double follow) {
    const bool touching = voice.end > voice.begin;
    const bool unknown = pair.direction[0] == 0.0 && pair.direction[1] == 0.0 && pair.direction[2] == 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        const double aim = voice.direction[1][axis];
        const double start = unknown && touching ? aim : pair.direction[axis];
        voice.direction[0][axis] = start;
        pair.direction[axis] = voice.direction[1][axis] = start + (touching ? follow * (aim - start) : 0.0);
    }
    bool moves = pair.depth != 0.0 || pair.separation_speed != 0.0;
    for (int side = 0; side < 2; ++side) {
        voice.sweep_m_s[0][side] = voice.fresh ? 0.0 : pair.sweep_m_s[side];
        pair.sweep_m_s[side] = voice.sweep_m_s[1][side];
        moves = moves || voice.sweep_m_s[0][side] > 0.0 || voice.sweep_m_s[1][side] > 0.0;
    }
    const double target_n = pair.support_n[1];
    voice.load_n[0] = pair.load_n, voice.load_n[1] = target_n;
    voice.moves = moves && (pair.load_n > 0.0 || target_n > 0.0);
    pair.load_n = target_n, pair.rubs = target_n > 0.0;
    return voice.moves;
}

// Collect the voices that move or begin in this step; return their number. All pairs advance to the step's end.
static int64_t collect_voices(const PairTables& pairs, Array<const Body, 1> bodies, Array<const ContactRow, 1> rows,
                              double follow, Array<Voice, 1> voices) {
    int64_t found = 0, row = 0;
    for (int64_t i = 0; i < pairs.count[0]; ++i) {
        const int64_t slot = pairs.active[i];
        Pair& pair = pairs.pair[slot];
        Voice& voice = voices[found];
        const Body &low = bodies[pair.body[0]], &high = bodies[pair.body[1]];
        voice.fresh = 0;
        if (!pair.rubs) {
            const bool active = low.modes > 0 || low.rigid > 0 || high.modes > 0 || high.rigid > 0;
            if (pair.support_n[1] <= 0.0 || !active || (low.mass_kg <= 0.0 && high.mass_kg <= 0.0)) continue;
            voice.fresh = 1, pair.depth = 0.0, pair.separation_speed = 0.0, pair.substeps = 0;
            pair.load_n = pair.support_n[1], pair.gains = 0;
            for (double& axis : pair.direction) axis = 0.0;
        }
        while (row < rows.size() && rows[row].key < pair.key) ++row;
        const int64_t begin = row;
        while (row < rows.size() && rows[row].key == pair.key) ++row;
        aim_voice(rows, begin, row, voice);
        voice.slot = slot;
        const bool moves = advance_pair(pair, voice, follow);
        found += moves || voice.fresh;
    }
    return found;
}

// Set what either side's profile is of. ball_m: R* of a ball, 0 for faces, which rest on many crests.
//
// Only a spectrum that is stated is limited by the ball's roundness, and only two of them tell how much of the patch
// touches: the slope of a preset's goes on below its finest wave, and with it the spots.
static void begin_surfaces(Pair& pair, Array<const Body, 1> bodies, double ball_m) {
    double slope = 0.0;
    pair.ball_m = ball_m;
    for (int side = 0; side < 2; ++side) {
        const Body& body = bodies[pair.body[side]];
        Octaves& height_m = pair.height_m[side];
        const bool stated = body.octave_rms_m[0] >= 0.0;
        if (stated) {
            given_octaves(body.octave_rms_m, height_m);
        } else {
            height_octaves(body.roughness_m, body.hurst, height_m);
        }
        add_waves(body.waviness_m, body.waviness_length_m, height_m);
        slope = stated && slope >= 0.0 ? slope + slope_squared(height_m) : -1.0;
        if (body.track_count > 0 || !stated) pair.ball_m = 0.0;
        pair.track_at[side] = body.track_at, pair.track_count[side] = body.track_count;
        pair.track_spacing_m[side] = body.track_spacing_m;
        if (body.track_count > 0)
            for (double& gain : height_m) gain = 1.0;
        pair.around[side] = pair.stretch[side] = 0.0;
        if (body.curvature_per_m > 0.0 && body.track_count == 0) {
            const ClosedLattice around = close_round(2.0 * std::numbers::pi / body.curvature_per_m, height_m);
            pair.around[side] = around.points, pair.stretch[side] = around.stretch;
        }
    }
    pair.slope = slope > 0.0 ? std::sqrt(2.0 * slope) : 0.0;  // of a gradient, of a trace's slope
}

// Set the constants of a voice by the manifold with which it begins: effective mass, curvature, spread.
// The curvature is that where the load is highest. Without rows: as two flats of the bodies' size.
static void begin_voice(Pair& pair, const BodyTables& table, Array<ContactRow, 1> rows, int64_t begin, int64_t end,
                        Array<const double, 2> quaternion_xyzw) {
    // radius, as a fraction of the smaller body's size, of the least area of friction of a flat face
    constexpr double friction_flat = 0.25;
    const Array<const Body, 1> bodies = table.bodies;
    const Body &low = bodies[pair.body[0]], &high = bodies[pair.body[1]];
    pair.modulus_pa = contact_modulus(low.modulus_pa, high.modulus_pa);
    pair.damping_ratio = DAMPING_RATIO;
    pair.dissipation_s_m = dissipation_s_m(low.restitution < high.restitution ? low.restitution : high.restitution);
    double total_n_s = 0.0, mobility = 0.0, curvature_per_m = 0.0, square_m2 = 0.0;
    for (int side = 0; side < 2; ++side) {
        const Body& body = side ? high : low;
        pair.swept_m[side] = 0.0, pair.seed[side] = body.surface_seed;
        mobility += body.mass_kg > 0.0 ? 1.0 / body.mass_kg : 0.0;
    }
    pair.mass_kg = 1.0 / mobility;
    int64_t strongest = begin;
    for (int64_t r = begin; r < end; ++r) {
        total_n_s += rows[r].load_n_s;
        if (rows[r].load_n_s > rows[strongest].load_n_s) strongest = r;
    }
    if (end > begin) {
        double normal[3] = {}, arm_m[2][3] = {}, point_m[3] = {};
        for (int64_t r = begin; r < end; ++r) {
            const ContactRow& row = rows[r];
            const double weight = row.load_n_s / total_n_s;
            for (int axis = 0; axis < 3; ++axis) {
                normal[axis] += weight * row.normal[axis];
                arm_m[0][axis] += weight * row.arm_m[0][axis];
                arm_m[1][axis] += weight * row.arm_m[1][axis];
                point_m[axis] += weight * row.point_m[0][axis];
            }
        }
        const double length = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        for (int axis = 0; axis < 3; ++axis) {
            normal[axis] /= length > 0.0 ? length : 1.0;
            for (int64_t r = begin; r < end; ++r) {
                const double off_m = rows[r].point_m[0][axis] - point_m[axis];
                square_m2 += rows[r].load_n_s / total_n_s * (off_m * off_m);
            }
        }
        pair.mass_kg = effective_mass(bodies, pair.body, quaternion_xyzw, arm_m, normal);
        find_contact_point(rows[strongest], table);
        curvature_per_m = rows[strongest].curvature_per_m[0] + rows[strongest].curvature_per_m[1];
    }
    const double area_m2 = flat_area_m2(bodies, pair.body, std::sqrt(square_m2), curvature_per_m, friction_flat);
    // faces touch on the crests of their waves [Johnson 1985, sec. 13.2]
    if (area_m2 > 0.0) curvature_per_m += low.crest_per_m + high.crest_per_m;
    pair.radius_m = contact_radius_m(curvature_per_m, area_m2);
    begin_surfaces(pair, bodies, area_m2 > 0.0 ? 0.0 : pair.radius_m);
}

// Fill the gains of a drive: Uᵀ per newton of either side at the step's start and end.
static void follow_gains(Pair& pair, const Voice& voice, double follow, Array<ContactRow, 1> rows,
                         const BodyTables& table, const PairTables& pairs, int64_t drive,
                         const ScratchTables& scratch) {
    for (int64_t r = voice.begin; r < voice.end; ++r) find_contact_point(rows[r], table);
    for (int side = 0; side < 2; ++side) {
        const Body& body = table.bodies[pair.body[side]];
        const Doubles start = scratch.gain0[drive][side], aim = scratch.gain1[drive][side];
        const Doubles kept = pairs.gain[voice.slot][side];
        for (int64_t c = 0; c < body.columns; ++c) aim[c] = 0.0;
        for (int64_t r = voice.begin; r < voice.end; ++r)
            add_modal_impulse(rows[r], side, 1.0 / voice.total_n_s, table, aim.data);
        turn_modal_impulse(body, table.turns, aim.data);
        for (int64_t c = 0; c < body.columns; ++c) {
            start[c] = pair.gains ? kept[c] : aim[c];
            aim[c] = voice.end > voice.begin ? start[c] + follow * (aim[c] - start[c]) : start[c];
            kept[c] = aim[c];
        }
        scratch.body(drive, side) = pair.body[side];
    }
    pair.gains = 1;
}

void advance_friction(int64_t number, Array<const double, 1> x, double sr, const WindowTables& window,
                      const BodyTables& table, const PairTables& pairs, Array<Voice, 1> voices,
                      const ScratchTables& scratch, ContactScratch& memory) {
    const Window &here = window.step[number % SPAN], &there = window.step[(number + 1) % SPAN];
    const Array<ContactRow, 1> rows = window.row.part(there.row[0], there.row[1]);
    const Array<const double, 2> quaternion_xyzw = window.quaternion_xyzw[(number + 1) % SPAN];
    const int64_t n = x.size();
    const Array<double, 2> force_n{scratch.force.data, {scratch.slot.size(), n}};
    const double follow = 1.0 - engine::exp(-here.dt_s / FOLLOW_S);
    const int64_t count = collect_voices(pairs, table.bodies, rows, follow, voices);
    int64_t moving = 0, drives = 0;
    for (int64_t v = 0; v < count; ++v) {
        const Voice& voice = voices[v];
        if (voice.fresh) begin_voice(pairs.pair[voice.slot], table, rows, voice.begin, voice.end, quaternion_xyzw);
        if (voice.moves) voices[moving++] = voice;
    }
    sound_voices(pairs.pair, voices.part(0, moving), x, sr, table.tracks, force_n, memory);
    for (int64_t v = 0; v < moving; ++v) {
        const Voice& voice = voices[v];
        Pair& pair = pairs.pair[voice.slot];
        if (voice.end == voice.begin && !pair.gains) continue;
        follow_gains(pair, voice, follow, rows, table, pairs, drives, scratch);
        for (int axis = 0; axis < 3; ++axis) {
            scratch.direction0(drives, axis) = voice.direction[0][axis];
            scratch.direction1(drives, axis) = voice.direction[1][axis];
        }
        scratch.slot[drives] = voice.slot;
        const Doubles from = force_n[v], to = force_n[drives];
        bool sounds = false;
        for (int64_t i = 0; i < n; ++i) {
            to[i] = from[i];
            sounds = sounds || from[i] != 0.0;
        }
        drives += sounds;
    }
    scratch.count[1] = drives;
}

}  // namespace engine
