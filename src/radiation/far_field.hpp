// What patches of a vibrating surface send far away: Σ over patches [v + ik r̂·(v y + n ψ)] e^{ik r̂·x}, for directions
// and their negatives                                                                       [Pierce 1989, eq. 4-6.4]
//
// m modes, s patches, n directions.
#pragma once

#include "../array.hpp"
#include "../vector_level.hpp"

namespace engine {

struct FarField {
    // k (m,); moment (m, 7, s): each patch's ∫ of v, v y + n Re ψ, n Im ψ; place (3, s); direction (n, 3) ->
    // ahead (m, n, 2) and, for -direction, behind: real and imaginary parts.
    void (*sum_patches)(Array<const double, 1> k, Array<const double, 3> moment, Array<const double, 2> place,
                        Array<const double, 2> direction, Array<double, 3> ahead, Array<double, 3> behind);
};
CHOOSE_VECTOR(FarField, far_field)

}  // namespace engine
