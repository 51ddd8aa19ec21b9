#include "contact_place.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "../math/rotation.hpp"
#include "contact_place_vector.hpp"

namespace engine {

// The face that says how a body is curved at a point: of the surface that it is touched on, else its own.
static const Face& touched_face(const Body& body, const BodyTables& table, const SurfacePoint& own,
                                const double point_m[3], const double outward[3]) {
    if (body.touched_faces == 0) return table.faces[body.face_at + own.face];
    const Face* faces = table.faces.data + body.touched_face_at;
    const Node* nodes = table.nodes.data + body.touched_node_at;
    return faces[nearest_point({faces, nodes, body.touched_wall_m, body.touched_tie_m}, point_m, outward).face];
}

CurvedPoint nearest_curved_point(const Body& body, const BodyTables& table, const double point_m[3],
                                 const double outward[3]) {
    CurvedPoint found{{-1, {0, 0, 0}, 0}, body.curvature_per_m};
    if (body.faces > 0) {
        const Face* faces = table.faces.data + body.face_at;
        found.at = nearest_point({faces, table.nodes.data + body.node_at, body.wall_m, body.tie_m}, point_m, outward);
        if (!std::isfinite(found.curvature_per_m)) {
            const Face& here = touched_face(body, table, found.at, point_m, outward);
            const double (&n)[3] = here.normal;
            const bool leans = n[0] * outward[0] + n[1] * outward[1] + n[2] * outward[2] < CREASE_COS;
            found.curvature_per_m = leans ? body.edge_per_m : here.curvature_per_m;
        }
    }
    if (!std::isfinite(found.curvature_per_m)) found.curvature_per_m = 0.0;
    return found;
}

void find_contact_point(ContactRow& row, const BodyTables& table) {
    if (row.touched) return;
    row.touched = 1;
    for (int side = 0; side < 2; ++side) {
        const auto [at, curvature_per_m] =
            nearest_curved_point(table.bodies[row.body[side]], table, row.point_m[side], row.outward[side]);
        row.face[side] = at.face;
        for (int i = 0; i < 3; ++i) row.barycentric[side][i] = at.barycentric[i];
        row.curvature_per_m[side] = curvature_per_m;
    }
}

void add_modal_impulse(const ContactRow& row, int side, double factor, const BodyTables& table, double* out) {
    if (row.face[side] < 0) return;
    const Body& body = table.bodies[row.body[side]];
    const Face& face = table.faces[body.face_at + row.face[side]];
    double impulse_n_s[3];
    for (int axis = 0; axis < 3; ++axis) impulse_n_s[axis] = factor * row.local_impulse_n_s[side][axis];
    for (int corner = 0; corner < 3; ++corner) {
        const double weight = row.barycentric[side][corner];
        const double weighted[3] = {weight * impulse_n_s[0], weight * impulse_n_s[1], weight * impulse_n_s[2]};
        const int64_t at = body.shape_at + 3 * face.vertex[corner] * body.columns;
        place_vector().add_shape(table.shapes.data + at, body.columns, weighted, out);
    }
}

void turn_modal_impulse(const Body& body, Array<const Turn, 1> turns, double* out) {
    for (int64_t q = 0; q < body.turns; ++q) {
        const Turn& pair = turns[body.turn_at + q];
        double& one = out[pair.mode];
        double& other = out[pair.mode + 1];
        const double first = one * pair.by[0][0] + other * pair.by[1][0];
        other = one * pair.by[0][1] + other * pair.by[1][1];
        one = first;
    }
}

// Compute the speed along n per impulse along it: gᵀ W g, g = (n, r × n) turned back, W (6, 6) in the body's frame.
static double jointed_mobility(const Body& body, const double* q, const double (&n)[3], const double (&moment)[3]) {
    double g[6];
    rotate_back(q, n, g);
    rotate_back(q, moment, g + 3);
    double total = 0.0;
    for (int row = 0; row < 6; ++row)
        for (int column = 0; column < 6; ++column) total += g[row] * body.mobility[row][column] * g[column];
    return total;
}

// Compute (r×n)·I⁻¹(r×n): a scalar, so it is computed in the body's frame, where its inertia is.
static double rotary_mobility(const Body& body, const double* q, const double (&moment)[3]) {
    double turned[3];
    rotate_back(q, moment, turned);
    const double a = turned[0], b = turned[1], c = turned[2];
    const double (&m)[3][3] = body.inertia_kg_m2;
    const double xx = m[0][0], xy = m[0][1], xz = m[0][2], yy = m[1][1], yz = m[1][2], zz = m[2][2];
    const double i = yy * zz - yz * yz, j = xz * yz - xy * zz, k = xy * yz - xz * yy;  // cofactors
    const double determinant = xx * i + xy * j + xz * k;
    if (determinant == 0.0) return 0.0;  // PyBullet's point masses do not turn
    const double own = a * a * i + b * b * (xx * zz - xz * xz) + c * c * (xx * yy - xy * xy);
    return (own + 2.0 * (a * b * j + a * c * k + b * c * (xy * xz - xx * yz))) / determinant;
}

double effective_mass(Array<const Body, 1> bodies, const int64_t (&pair)[2], Array<const double, 2> quaternion_xyzw,
                      const double (&arm_m)[2][3], const double (&normal)[3]) {
    double mobility = 0.0;
    const double (&n)[3] = normal;
    for (int side = 0; side < 2; ++side) {
        const Body& body = bodies[pair[side]];
        const double* q = quaternion_xyzw[pair[side]].data;
        const double (&r)[3] = arm_m[side];
        const double moment[3] = {r[1] * n[2] - r[2] * n[1], r[2] * n[0] - r[0] * n[2], r[0] * n[1] - r[1] * n[0]};
        if (body.jointed) {
            mobility += jointed_mobility(body, q, n, moment);
        } else if (body.mass_kg > 0.0) {
            mobility += 1.0 / body.mass_kg;
            mobility += rotary_mobility(body, q, moment);
        }
    }
    return mobility > 0.0 ? 1.0 / mobility : 0.0;
}

double flat_area_m2(Array<const Body, 1> bodies, const int64_t (&pair)[2], double spread_m, double curvature_per_m,
                    double least_fraction) {
    constexpr double endless = std::numeric_limits<double>::infinity();
    double size_m = endless;
    for (int64_t b : pair)
        if (bodies[b].volume_m3 > 0.0) size_m = std::min(size_m, bodies[b].size_m);
    if (size_m == endless) size_m = SIZELESS_M;
    if (curvature_per_m * size_m > FLAT_CURVATURE) return 0.0;
    const double radius_m = std::max(spread_m, least_fraction * size_m);
    return std::numbers::pi * (radius_m * radius_m);
}

}  // namespace engine
