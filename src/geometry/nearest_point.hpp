// The point of a body's surface nearest to a point, by a tree of boxes over its faces.
#pragma once

#include "../tables.hpp"

namespace engine {

constexpr int DEEPEST = 64;  // boxes that wait in a search, one a level and one: a balanced tree has far fewer levels

struct SurfacePoint {
    int64_t face;           // counted from the body's own first, in tree order
    double barycentric[3];  // of the face's corners
    double distance_m;
};

// A body's surface in the flat tables.
struct Surface {
    const Face* faces;
    const Node* nodes;
    double wall_m;  // the thinnest wall: a face behind it is not meant
    double tie_m;   // what counts as equally near
};

// Find the point nearest to p. outward: the normal that the surface should have there, zeros for any.
SurfacePoint nearest_point(const Surface& surface, const double p[3], const double outward[3]);

}  // namespace engine
