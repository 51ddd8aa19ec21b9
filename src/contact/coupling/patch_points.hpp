// Points of a contact patch on both bodies: axes, motion of each mode and rigid motion along them, curvature.
//
//     n, t₁, t₂ of the patch -> axes of either body's frame;
//         Φ = (axes · Σ_c w_c φ_c,  axes · (1/√M, (r ×) J^{−1/2}))
//
// Rows of `mobility.BodyMobility.moves`, from the run time's tables.
#pragma once

#include "../../groups.hpp"

namespace engine {

// Fill moves of both bodies, (points, 3, modes + 6) of zeros each, and curvature_per_m (points,) of zeros; return the
// distance of the points' middle from the farther surface.
//
// quaternion (b, 4): all bodies'; both: the two of the patch; turn (2, 3, 3): J^{−1/2} of either, by columns.
double place_points(const BodyTables& tables, Array<const double, 2> quaternion, const ContactPatch& patch,
                    const int64_t (&both)[2], Array<const double, 3> turn, const Array<double, 3> (&moves)[2],
                    Doubles curvature_per_m);

}  // namespace engine
