// How loud the image of a body in a face is at a microphone, at both ends of a step.
//
//     g = R · F · Π_k (1 - F_k),   R = (cos θ - β)/(cos θ + β),   β = ρ₀c₀/(ρ c_P)      [Pierce 1989, eq. 3-3.4, 3-6.5]
//
// x: the body's centre, M' the microphone's image, P where the line between them meets the face, θ: from its normal
// there. F of a face: 1 well within its edges, a half on them, 0 beyond, over the width of the first zone of
// diffraction at 1 kHz, v = ±2√(δ/λ), + inwards of an edge; δ: how much longer the way over the edge is than the
// straight one
//                                                                     [Maekawa 1968, Appl. Acoust. 1, 157: N = 2δ/λ]
//     δ = √((ρ + ρ')² + a²) - |xM'|,   ρ, ρ': of x and M' from the edge's line, a: between them along it
//
// F_k: of another face of the microphone that lies between, as a table-top is above a floor. A body has no image in its
// own face, nor behind it; a face that moves has none. b bodies, c microphones.
#pragma once

#include "../tables.hpp"

namespace engine {

// Faces that mirror, and where bodies are at the step's start and end.
struct ImageScene {
    Array<const Image, 1> images;               // (c,); (0,): none
    Array<const int64_t, 1> has_image;          // (b,) 1 where a body may have images
    Array<const double, 2> position_m[2];       // (b, 3)
    Array<const double, 2> quaternion_xyzw[2];  // (b, 4)
};

// Compute g (2, b, c) at both ends of a step, 1 of own microphones; without images nothing is written, and
// `Course.gain` stays empty. aim_m: as `Course` has it.
void image_gains(const ImageScene& scene, Array<const double, 4> aim_m, Array<const double, 2> microphone_m,
                 Array<double, 3> gain);

}  // namespace engine
