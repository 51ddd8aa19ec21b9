// Location of a contact on both bodies' true surfaces, and its force on their modes: for strikes and friction.
//
//     ContactRow -> find_contact_point: nearest triangle, weights, curvature, once a row -> add_modal_impulse: Uᵀj
//     1/m* = Σ [1/m + (r×n)·I⁻¹(r×n)]    [Johnson 1985, sec. 11.1]
//
// Triangles are looked up only for rows with a strike or friction: each stage asks for those it needs.
#pragma once

#include "../geometry/nearest_point.hpp"
#include "../groups.hpp"

namespace engine {

// A point of a body's surface, and the curvature of the body there: that of its edges where the face leans from the
// normal, 0 where none is known. The face is that of the surface as given, where elements lean from it.
struct CurvedPoint {
    SurfacePoint at;  // face -1: the body has no surface
    double curvature_per_m;
};
CurvedPoint nearest_curved_point(const Body& body, const BodyTables& table, const double point_m[3],
                                 const double outward[3]);

// Cosine of 20°: a contact whose normal leans more from the face's touches an edge or corner.
constexpr double CREASE_COS = 0.9396926207859084;
// Curvature times size below which a contact is flat: a cap of ten times the body's size.
constexpr double FLAT_CURVATURE = 0.1;
// Size of a pair of which neither body has a volume (planes and links without a solid).
constexpr double SIZELESS_M = 0.1;

// Find face, weights and curvature of a row on either body: its fields face, barycentric, curvature_per_m.
//
// Nothing is done where they are known already. Where the contact's normal leans more than 20° from the face's, an edge
// or corner is touched: its curvature is the body's edge_per_m.
void find_contact_point(ContactRow& row, const BodyTables& table);

// Add factor·Uᵀj of a row on the body of a side, of its free modes, to out (columns,).
//
// Uᵀj: the shapes, linear in the triangle, times the row's impulse in N·s (with factor 1: N·s/√kg). Find the row's
// contact point first. out may be longer than the body's columns.
void add_modal_impulse(const ContactRow& row, int side, double factor, const BodyTables& table, double* out);

// Turn Uᵀj in out (columns,), of a body's free modes, to its modes as they are: Rᵀ Uᵀj of each of its pairs.
void turn_modal_impulse(const Body& body, Array<const Turn, 1> turns, double* out);

// Compute m* in kg of two bodies, 0 where neither moves. quaternion_xyzw (b, 4) of all; levers from their centres to
// the contact and its normal, in the world.
double effective_mass(Array<const Body, 1> bodies, const int64_t (&pair)[2], Array<const double, 2> quaternion_xyzw,
                      const double (&arm_m)[2][3], const double (&normal)[3]);

// Compute the area of a flat contact of two bodies, 0 where it is curved: the disc with the points' spread.
//
// spread_m: root of Σ w·|p - Σ w·p|² of the points p under loads w of sum 1. least_fraction: of the smaller body's
// size, least radius of a flat contact.
double flat_area_m2(Array<const Body, 1> bodies, const int64_t (&pair)[2], double spread_m, double curvature_per_m,
                    double least_fraction);

}  // namespace engine
