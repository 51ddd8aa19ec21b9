// What constant sources and dipoles on triangles make at the triangles' centroids, at k = 0: all integrals in closed
// form, of which sonic_bullet/radiation/entrained_mass.py solves how air moves with a surface.
//
//     S v = ∮ v/4πr dS,  K φ = ∮ φ ∂(1/4πr)/∂n_y dS;  K', D: their derivatives along n_x
//
// Potential of a triangle [Wilton et al. 1984, eq. 5], solid angle [van Oosterom & Strackee 1983, eq. 8], loop [Katz &
// Plotkin 2001, eq. 10.115]. f triangles.
#pragma once

#include "../array.hpp"
#include "../vector_level.hpp"

namespace engine {

// Compute 4π times S, K, K', D (4, f, f), [j, i] of triangle j at the centroid of i, for corners (f, 3, 3) and outward
// normals (f, 3).
void static_kernels(Array<const double, 3> corner_m, Array<const double, 2> normal, Array<double, 3> out);

// A triangle, its edges' outward normals in its plane, and their lengths.
struct Panel {
    double corner_m[3][3];
    double normal[3];
    double across[3][3];
    double edge_m[3];
};

// Places and normals of eight triangles.
struct Targets {
    double place_m[3][8];
    double normal[3][8];
};

struct Panels {
    // S, K, K', D of a panel at eight targets.
    void (*integrate)(const Panel& panel, const Targets& targets, double (*out)[8]);
};
CHOOSE_VECTOR(Panels, panels)

}  // namespace engine
