// Matrices of the exterior Helmholtz problem at one frequency, of which sonic_bullet/radiation/surface_waves.py solves
// the potential on a vibrating surface.
//
//     (½ - K - βD) φ = (S + β(½ + K')) v,   β = ib           [Burton & Miller 1971, eq. 3.5]
//
// The kernels at k = 0, and what k adds to D in ½k² n·n'/r, are in closed form (panels.hpp); the smooth rest is taken
// at centroids. Single precision. f triangles.
#pragma once

#include "../array.hpp"
#include "../vector_level.hpp"

namespace engine {

struct SurfaceWaves {
    // Compute ½ - K - βD and S + β(½ + K') at k, each (f, f, 2), [j, i]: real and imaginary parts.
    // place (7, f): centroids, normals, areas; kernels (4, f, f): S, K, K', D at k = 0 times 4π.
    void (*matrices)(float k, float b, Array<const float, 2> place, Array<const float, 3> kernels, Array<float, 3> left,
                     Array<float, 3> right);
};
CHOOSE_VECTOR(SurfaceWaves, surface_waves)

}  // namespace engine
