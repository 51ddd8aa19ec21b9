// Tables that travel together through the stages of the run time, each field named as where Python keeps it.
//
//     window, table, pairs, supports, scratch -> contact, bank, path          sonic_bullet/engine/runtime/synthesis_state.py
//
// b bodies, c columns of the body with most, d drives, p pulses, n samples, W weight sets.
#pragma once

#include "tables.hpp"

namespace engine {

// The last SPAN steps, step k in place k % SPAN; and faces that mirror.
struct WindowTables {
    Array<Window, 1> step;
    Array<double, 3> position_m;  // (SPAN, b, 3), as what follows
    Array<double, 3> quaternion_xyzw;
    Array<bool, 2> teleported;
    Array<ContactRow, 1> row;  // as many for each step
    Array<Image, 1> images;
    Integers has_image;
};
GROUP_FIELDS(WindowTables, step, position_m, quaternion_xyzw, teleported, row, images, has_image)

// Bodies and what belongs to their models, flat: a body's row holds its places in the others.
struct BodyTables {
    Array<Body, 1> bodies;
    Array<const Face, 1> faces;
    Array<const Node, 1> nodes;
    Array<const float, 1> shapes;
    Array<Turn, 1> turns;
    Array<const double, 1> frequency_hz;
    Array<const double, 2> spectrum;  // of Hertz' and of the flat pulse
    Array<const double, 1> tracks;    // slopes of measured tracks by octave
};
GROUP_FIELDS(BodyTables, bodies, faces, nodes, shapes, turns, frequency_hz, spectrum, tracks)

// Pairs that touch. A pair keeps its place in `pair`, `gain` and `patch` as long as it does.
struct PairTables {
    Array<Pair, 1> pair;
    Integers active;               // places in use, by the pairs' keys
    Integers count;                // (2,): how many of `active` and of `free` hold
    Integers free;                 // the other places, the next one to be taken last
    Array<double, 3> gain;         // (places, 2, c): Uᵀ of friction per newton of either side, carried
    Array<ContactPatch, 1> patch;  // one a place
};
GROUP_FIELDS(PairTables, pair, active, count, free, gain, patch)

struct SupportTables {
    Array<SupportState, 1> support_state;  // (b,)
    Doubles credit_s;                      // (1,): time left for new poles; (0,) where nothing supports
};
GROUP_FIELDS(SupportTables, support_state, credit_s)

// One step: pulses and drives in, sound out.
struct ScratchTables {
    Integers count;                  // (2,): pulses, drives
    Array<Pulse, 1> pulse;           // (p,)
    Array<double, 3> modal_impulse;  // (p, 2, c)
    Doubles force;                   // (d·n,)
    Array<double, 3> gain0;          // (d, 2, c): at the step's start, and at its end
    Array<double, 3> gain1;
    Array<double, 2> direction0;  // (d, 3)
    Array<double, 2> direction1;
    Array<int64_t, 2> body;        // (d, 2)
    Integers slot;                 // (d,): place of the pair
    Array<double, 3> source;       // (W, b, n)
    Array<double, 3> transmitted;  // (W, b, n): zeros between steps
    Array<double, 3> dipole;       // (b, 3, n)
    Array<int64_t, 2> sounds;      // (b, 2): which rows of source and dipole are not zero
};
GROUP_FIELDS(ScratchTables, count, pulse, modal_impulse, force, gain0, gain1, direction0, direction1, body, slot,
             source, transmitted, dipole, sounds)

}  // namespace engine
