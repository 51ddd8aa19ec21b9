// Rows of the run time's tables, each declared once: python/arrays.hpp makes NumPy's dtypes of them.
//
//     Body + Face, Node rows and a slice of the shapes       once, when a body is added
//     Contact (as logged) -> ContactRow (turned onto the pair's lower body)     four steps at a time
//     pair of touching bodies -> Pair, ContactPatch          as long as it touches: load history, voice of friction
//     strike -> Strike -> Pulse -> BankStrike                one step; then until it has acted
//
// Sides are 0 = the pair's lower body and 1 = the higher.
#pragma once

#include "array.hpp"
#include "row_fields.hpp"

namespace engine {

constexpr int OCTAVES = 14;  // of a surface's waves
constexpr int HISTORY = 7;   // steps of which a pair remembers its load

// Key of a pair of bodies: as the keys are sorted, so are the pairs, by the first body and then the second.
inline int64_t pair_key(int64_t first, int64_t second) {
    return first << 32 | second;
}

// One contact: 20 numbers of 8 bytes, both indices in the first; see `Contacts`.
struct Contact {
    int32_t a;
    int32_t b;
    double point_a_m[3];
    double point_b_m[3];
    double normal[3];
    double impulse_n_s[3];
    double slip_m_s[3];
    double sweep_m_s[2];
    double approach_m_s;
    double gap_m;
};
ROW_FIELDS(Contact, a, b, point_a_m, point_b_m, normal, impulse_n_s, slip_m_s, sweep_m_s, approach_m_s, gap_m)

// A physics step for the driver: what is taken in, and the time of what is rendered then.
struct StepRow {
    double dt_s;  // of the step taken in
    double gravity_m_s2[3];
    int64_t row[2];  // its contacts: first and the one after the last
    int64_t sample;  // first sample of the step that is rendered, LOOKAHEAD before
    int64_t count;   // samples of it; 0 while there is none
    double offset;   // of the first sample behind the step's start, in samples
    double begin_s;  // time at which it starts, and at which the one after it does
    double after_s;
    int64_t quench;  // 1: all stops ringing before the step after it
};
ROW_FIELDS(StepRow, dt_s, gravity_m_s2, row, sample, count, offset, begin_s, after_s, quench)

struct Body {
    double mass_kg;              // 0 for what does not move
    double inertia_kg_m2[3][3];  // body frame
    int64_t jointed;             // 1: how it moves is the mobility, not mass and inertia
    double mobility[6][6];       // velocity and spin per impulse and its moment, body frame
    double modulus_pa;           // E/(1-ν²), infinite where it is a rigid partner
    double restitution;          // infinite where it has no material
    double roughness_m;
    double hurst;
    double octave_rms_m[OCTAVES];  // the first below 0: roughness and hurst tell
    double waviness_m;             // 0: none known
    double waviness_length_m;
    double crest_per_m;   // curvature of its waves' crests
    int64_t track_at;     // of a measured track's slopes by octave in the flat ones, and how many an octave has
    int64_t track_count;  // 0: none
    double track_spacing_m;
    double size_m;  // cube root of the volume
    double volume_m3;
    double curvature_per_m;  // of a shape that has one everywhere; NaN: that of its faces
    double edge_per_m;       // curvature of its edges
    double wall_m;           // see geometry.nearest_point
    double tie_m;
    int64_t surface_seed;
    int64_t rigid;         // 1 where its translations are active
    int64_t modes;         // audible modes
    int64_t columns;       // the same and the lines of its residual: what shapes and gains are given for
    int64_t frequency_at;  // of mode 0 in the flat array of frequencies in Hz (m,)
    int64_t shape_at;      // of vertex 0, axis 0, column 0 in the flat shapes: + (3·vertex + axis)·columns + column
    int64_t face_at;
    int64_t faces;  // 0: no surface
    int64_t node_at;
    int64_t touched_face_at;  // the same of the surface that says how it is curved where it is touched
    int64_t touched_faces;    // 0: its own says it
    int64_t touched_node_at;
    double touched_wall_m;
    double touched_tie_m;
    int64_t placed;    // step in which it began or was last teleported
    double rebound;    // restitution as the simulator has it; a pair's is the product
    int64_t loaded;    // last step before the present one in which it carried load
    double cause_m_s;  // approach of its last strike that gravity and bouncing did not make, and its step
    int64_t cause_step;
    double since_m_s;  // approach of the fastest such strike after that one, and its step
    int64_t since_step;
    int64_t undated_strikes;  // so far: the phase of the next (contact/strike_timing.hpp)
    int64_t turn_at;          // first row of TURN, and how many: its pairs of modes that are not as they are free
    int64_t turns;
};
ROW_FIELDS(Body, mass_kg, inertia_kg_m2, jointed, mobility, modulus_pa, restitution, roughness_m, hurst, octave_rms_m,
           waviness_m, waviness_length_m, crest_per_m, track_at, track_count, track_spacing_m, size_m, volume_m3,
           curvature_per_m, edge_per_m, wall_m, tie_m, surface_seed, rigid, modes, columns, frequency_at, shape_at,
           face_at, faces, node_at, touched_face_at, touched_faces, touched_node_at, touched_wall_m, touched_tie_m,
           placed, rebound, loaded, cause_m_s, cause_step, since_m_s, since_step,
           undated_strikes, turn_at, turns)

// A pair of modes, that mode and the next, turned from the free ones: their shapes times ``by``.
struct Turn {
    int64_t mode;
    double by[2][2];
};
ROW_FIELDS(Turn, mode, by)

struct ContactRow {
    int64_t key;  // of the pair, lower body first
    int64_t body[2];
    double impulse_n_s[3];           // on the lower body, world frame
    double normal[3];                // towards the lower body, world frame
    double load_n_s;                 // normal part of the impulse
    double point_m[2][3];            // in either body's frame
    double outward[2][3];            // the surface's normal there, body frame
    double local_impulse_n_s[2][3];  // impulse on that body, body frame
    double arm_m[2][3];              // from its centre, world frame
    double sweep_m_s[2];
    double approach_m_s;
    double gap_m;
    int64_t touched;  // 1 once what follows is known
    int64_t face[2];  // of the body's own faces, in tree order; -1: it has no surface
    double barycentric[2][3];
    double curvature_per_m[2];
};
ROW_FIELDS(ContactRow, key, body, impulse_n_s, normal, load_n_s, point_m, outward, local_impulse_n_s, arm_m, sweep_m_s,
           approach_m_s, gap_m, touched, face, barycentric, curvature_per_m)

struct Pair {
    int64_t key;
    int64_t body[2];
    double force_n[HISTORY];   // normal load of each step
    double struck_n[HISTORY];  // part of it used up by strikes
    double support_n[2];       // silent load at the rendered step's start and end
    int64_t rubs;              // 1 while it has a voice: what follows holds
    double load_n;             // at the end of the step before
    double sweep_m_s[2];
    double direction[3];  // force on the lower body per newton of load, world; 0: not yet known
    int64_t gains;        // 1 once its row of the gains is known
    double mass_kg;       // from here: constants of its voice
    double modulus_pa;
    double radius_m;
    double damping_ratio;
    double dissipation_s_m;
    int64_t seed[2];
    double height_m[2][OCTAVES];  // gains of the slopes, where a side has a track
    double around[2];             // coarsest lattice points round a round side, 0: endless (profile.close_round)
    double stretch[2];            // of its lattice, over 1
    int64_t track_at[2];
    int64_t track_count[2];
    double track_spacing_m[2];
    double ball_m;  // R* of a ball on a stated spectrum, 0: it follows all waves
    double slope;   // rms, of both surfaces; 0: not known, the contact is in spots
    double depth;   // from here: state of its voice
    double separation_speed;
    int64_t substeps;
    double swept_m[2];
};
ROW_FIELDS(Pair, key, body, force_n, struck_n, support_n, rubs, load_n, sweep_m_s, direction, gains, mass_kg,
           modulus_pa, radius_m, damping_ratio, dissipation_s_m, seed, height_m, around, stretch, track_at, track_count,
           track_spacing_m, ball_m, slope, depth, separation_speed, substeps, swept_m)

// A step of the last SPAN: its length, its gravity, and its rows, first and the one after the last.
struct Window {
    double dt_s;
    double gravity_m_s2[3];
    int64_t row[2];
};
ROW_FIELDS(Window, dt_s, gravity_m_s2, row)

// One strike. Its Uᵀj on both bodies' columns stands beside it in an array (pulses, 2, columns).
struct Pulse {
    int64_t body[2];
    double start_s;  // after the start of the step it was found in; before it, where negative
    double length_s;
    int64_t flat;                 // half-sine, not Hertz'
    double transmitted_fraction;  // of the impulse (contact.pulse_shape.compliance)
    double impulse_n_s[3];        // on the lower body, world frame
    int64_t ahead;                // 0: found in the step being rendered, 1: in the one after it
};
ROW_FIELDS(Pulse, body, start_s, length_s, flat, transmitted_fraction, impulse_n_s, ahead)

// A triangle, in the order of its body's tree. vertex: the body's own numbers.
struct Face {
    double corner_m[3][3];
    double normal[3];
    double curvature_per_m;
    int64_t vertex[3];
};
ROW_FIELDS(Face, corner_m, normal, curvature_per_m, vertex)

// A box of a body's tree. child: both children, or (-start - 1, end) of a leaf, counted from the body's own first.
struct Node {
    double low_m[3];
    double high_m[3];
    int64_t child[2];
};
ROW_FIELDS(Node, low_m, high_m, child)

// Contact patch of a pair; beside its row of PAIR, in the same slot.
struct ContactPatch {
    int64_t count;
    double point_m[4][2][3];  // in either body's frame
    double load_n[4];
    double outward[2][3];  // of either body's surface, its frame, mean over the points
    int64_t used;          // of the set that poles were made for: how many points
    double used_m[4][2][3];
    double used_n[4];
    double used_s;  // since then
};
ROW_FIELDS(ContactPatch, count, point_m, load_n, outward, used, used_m, used_n, used_s)

// Support state of a body.
struct SupportState {
    int64_t stale;    // 1 where its poles are not those of its contacts
    double stale_s;   // since when
    double wait_s;    // until they may be made again
    int64_t wanted;   // 1: they are to be made before this step rings
    int64_t points;   // tracked points of its poles
    int64_t updates;  // how often they were made
    int64_t steps;    // steps that it rang on them, and below those with contact separation
    int64_t separated;
};
ROW_FIELDS(SupportState, stale, stale_s, wait_s, wanted, points, updates, steps, separated)

// A candidate strike: one for each active pair at most.
struct Strike {
    int64_t body[2];
    double fraction[3];     // of the normal impulse of its steps
    int64_t row[3][2];      // its rows in each of them: first and the one after the last
    double raw_n_s;         // normal impulse of these shares
    double impulse_n_s[3];  // the whole of them, on the lower body, world frame
    double normal[3];
    double arm_m[2][3];
    double centre_m[3];  // of its points, in the lower body's frame
    double approach_m_s;
    double meets_s;     // after the start of its first step; negative where the surfaces overlap already
    int64_t dated;      // 1 where meets_s is known
    int64_t overlaps;   // 1 where the surfaces overlap as its first step starts
    double budget_n_s;  // what the approach can cause
    double accepted_n_s;
    int64_t pulse;    // its row among the pulses, -1 where it is not audible
    double length_s;  // of it
};
ROW_FIELDS(Strike, body, fraction, row, raw_n_s, impulse_n_s, normal, arm_m, centre_m, approach_m_s, meets_s, dated,
           overlaps, budget_n_s, accepted_n_s, pulse, length_s)

// A contact oscillator that moves, for one step: scratch.
struct Voice {
    int64_t slot;            // of its pair
    int64_t moves;           // 0: it only begins
    int64_t fresh;           // 1: it begins
    double load_n[2];        // at the step's start and end, as all that follows
    double sweep_m_s[2][2];  // over the lower and the higher body's surface
    double direction[2][3];  // of the force on the lower body, world frame, per newton of load
    int64_t begin;           // its rows of the step that follows
    int64_t end;
    double total_n_s;  // their load
    int64_t order;     // index of the voice at this position of the order
};
ROW_FIELDS(Voice, slot, moves, fresh, load_n, sweep_m_s, direction, begin, end, total_n_s, order)

struct BankBody {
    int64_t start;  // lanes in the flat arrays
    int64_t stop;
    int64_t columns;           // of those, in use
    int64_t bent;              // 1: its poles depend on its level
    int64_t rigid;             // 1: its translations are active
    double rigid_log_pole[2];  // s of the translations
    double rigid_pole[2];
    double rigid_onset[2];    // (1 + i d/ω)(e^s - 1)/s: of a force that acts evenly over the sample before
    double rigid_quadrature;  // d/ω
    double rigid_weight;      // Pa·m per N·s
};
ROW_FIELDS(BankBody, start, stop, columns, bent, rigid, rigid_log_pole, rigid_pole, rigid_onset, rigid_quadrature,
           rigid_weight)

struct Ringing {
    int64_t ringing;        // 1: z is not zero
    int64_t driven;         // 1: driven is not zero
    int64_t tiled;          // 1: the block's free sound is not zero
    int64_t moving;         // 1: a translation's state is not zero
    int64_t fresh;          // 1: other poles at the next block's start
    int64_t transmissions;  // that are not off
    int64_t passed_to;      // 1: within a call, a body transmitted to it
    int64_t strike;         // slot of its first strike, -1 for none
    double motion[3][2];    // state of the translations
};
ROW_FIELDS(Ringing, ringing, driven, tiled, moving, fresh, transmissions, passed_to, strike, motion)

struct BankStrike {
    double start;      // absolute time of the pulse, in samples
    double length;     // in samples
    int64_t flat;      // half-sine, not Hertz'
    int64_t next;      // slot of the body's next strike, -1 for none
    int64_t modal;     // 1 while nodes are to come
    int64_t count;     // nodes
    double force_sum;  // of the pulse at all of them
    double ahead;      // how far after the edge of its first cell it starts
    double spacing;    // δ in samples
    int64_t whole;     // 1/δ
    int64_t first;     // sample at or after the first node
    int64_t within;    // nodes up to it
    int64_t upcoming;  // next node
    double phase;      // of the sample before, after the last node
    int64_t rigid;     // 1 while cells are to come
    int64_t cells;     // a sample
    int64_t cell_first;
    int64_t cell_stop;
    double cell_turn[2];   // e^{s/cells} of the translations
    double cell_onset[2];  // response to a cell's impulse at the cell's end
    double rigid_impulse_n_s[3];
};
ROW_FIELDS(BankStrike, start, length, flat, next, modal, count, force_sum, ahead, spacing, whole, first, within,
           upcoming, phase, rigid, cells, cell_first, cell_stop, cell_turn, cell_onset, rigid_impulse_n_s)

struct Transmission {
    int64_t to;
    int64_t phase;
};
ROW_FIELDS(Transmission, to, phase)

// A body that emits sound.
struct Source {
    double radius_m;
    int64_t oldest;   // place: the first of its chain
    int64_t main;     // its present place, the last of the chain
    int64_t leaving;  // the place it left in step ``left``; -1: none
    int64_t left;     // step in which it was last teleported; -1: none
    int64_t sounds;   // 1: emits something in this call
    int64_t fresh;    // place it gets in this call; -1: none
    double away_m;    // where `hear` says too far: from the farthest microphone; else 0
};
ROW_FIELDS(Source, radius_m, oldest, main, leaving, left, sounds, fresh, away_m)

// A body's present position or one from which it was teleported.
struct Place {
    int64_t body;      // -1: free
    int64_t next;      // the body's following place; -1: none
    double rest_m[3];  // where it lies, once left
    int64_t size;      // samples remembered, a power of two
    int64_t need;      // where `hear` says its memory is short: samples it must remember at least
    int64_t memory_at;
};
ROW_FIELDS(Place, body, next, rest_m, size, need, memory_at)

// awake: sound is under way; cursor: the emitted sample arrived last; newest: the last emitted that is not zero.
struct Line {
    int64_t awake;
    int64_t cursor;
    int64_t newest;
};
ROW_FIELDS(Line, awake, cursor, newest)

// A microphone, in the order of the path's.
struct Image {
    int64_t own;     // the microphone that it is of; -1: it is an own one
    int64_t active;  // 1: it has a face
    int64_t owner;   // body whose face it is
    double normal[3];
    double offset_m;  // normal · x on the face
    double centre_m[3];
    double axis[2][3];  // along its sides
    double half_m[2];
    double admittance;     // over that of air
    double position_m[3];  // pose of the owner
    double quaternion_xyzw[4];
};
ROW_FIELDS(Image, own, active, owner, normal, offset_m, centre_m, axis, half_m, admittance, position_m, quaternion_xyzw)

}  // namespace engine
