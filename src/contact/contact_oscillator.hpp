// Rolling and sliding: one contact oscillator a touching pair, excited by the height profiles its two surfaces sweep.
//
//     dz/dt = dh_a/dt + dh_b/dt - u
//         z: penetration beyond the resting one, u: speed of contact separation
//     m* du/dt = f - N
//     δ = δ0(N) + z,   f = k δ^(3/2) (1 + c(dh/dt - u)),  never below 0
//         [Hunt & Crossley 1975, eq. 12; clamped: micro-collisions]
//     N = k δ0^(3/2);  k, and the patch's radius a: `hertz`
//     c = 2ζ √(m* dN/dδ0)/N,  at least 3/2 (1 - e) s/m      ζ = 0.25: waves into both bodies; e: restitution at 1 m/s
//
// The oscillator gives f - N in newton: along the normal as it is; times the friction direction and coefficient for
// slip. Rolling (both surfaces sweep), sliding (one does) and anything between differ in the two sweep speeds only: no
// switch. A contact at rest is an exact equilibrium (z = u = 0 gives f = N to the bit) whatever N does, so support at
// rest and a load that drifts are silent; a new pair starts there, without a click. Within a step δ0, c, speeds and
// gains run linearly from the step's start to its end.
//
// Time: semi-implicit Euler, the damping implicit, 1 … 8 substeps a sample by the contact's resonance at the step's
// loads. Beyond the penetration at which the contact's own stiffness would pass m*/h² (substep h: a resonance of
// sr·substeps/2π) the law continues as a straight line, so ωh ≤ 1 everywhere and the scheme is stable for any
// stiffness, mass and load [Hairer, Lubich, Wanner 2006, I.1.4]. A sample depends on the sample before it and on its
// step alone: any split into blocks gives the same bits, whatever other pairs there are.
//
// Data flow, for the oscillators that move in a step: contact_law -> rates of eight (profile, track) -> oscillate: the
// eight at once, one a lane -> f - N, a row each. State and constants stand in the table of pairs, loads and speeds of
// the step in Voice. Lengths in δ_lim, forces in k·δ_lim^(3/2), u and dh/dt in δ_lim/h, damping in h/δ_lim: then for
// every pair f = min(δ, 1)^(3/2) + 1.5(δ - 1)₊, and one substep adds (h²/m*)·k·√δ_lim = 2/3 of the force to u. The
// units follow the substeps; nothing is rounded twice.
#pragma once

#include "contact_scratch.hpp"

namespace engine {

constexpr int MOST_SUBSTEPS = 8;
constexpr double FASTEST_M_S = 50.0;
// ζ, a model's choice: a rough contact sends waves into both bodies. With less, the level laws of rough, stiff, fast
// pairs bend (studies/surface_law.py).
constexpr double DAMPING_RATIO = 0.25;

// Compute c in s/m by the restitution of an impact at 1 m/s: c = 3/2 α, e = 1 - αv [Hunt & Crossley 1975].
// At the mm/s at which rough surfaces meet it leaves e near 1, whatever the impact's is.
double dissipation_s_m(double restitution);

// Compute R* = 1/(κ1+κ2), at most the radius √(A/π) of the nominal contact area (1 m where A is 0: none known).
// A flat face rests on its highest spots; each is taken for a cap as blunt as the face is wide.
double contact_radius_m(double relative_curvature_per_m, double flat_area_m2);

// Compute the contact law of a voice in this step.
ContactLaw contact_law(const Pair& pair, const Voice& voice, double sr);

// Compute the force f - N in newton of the voices (v,) into force_n (≥ v, n), and advance their pairs.
//
// x (n,): fractions in [0, 1) of one physics step at the n samples. Call again with the rest of the step's x for its
// other samples. sr in Hz. tracks: slopes of measured tracks, flat.
void sound_voices(Array<Pair, 1> pairs, Array<Voice, 1> voices, Array<const double, 1> x, double sr,
                  Array<const double, 1> tracks, Array<double, 2> force_n, ContactScratch& memory);

}  // namespace engine
