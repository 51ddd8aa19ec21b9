#include "patch_points.hpp"

#include <algorithm>
#include <cmath>

#include "../../math/rotation.hpp"
#include "../contact_place.hpp"

namespace engine {

namespace {

// Write normal and two tangents as rows, in either body's frame, the same directions for both.
void write_axes(Array<const double, 2> quaternion, const int64_t (&both)[2], const ContactPatch& patch,
                double (&axes)[2][3][3]) {
    double turn[2][3][3];
    for (int side = 0; side < 2; ++side) fill_rotation(quaternion[both[side]].data, turn[side]);
    constexpr double along_x = 0.6;  // a normal's part along x from which another tangent is better conditioned
    const double (&n)[3] = patch.outward[0];
    double normal[3];
    for (int i = 0; i < 3; ++i) normal[i] = turn[0][i][0] * n[0] + turn[0][i][1] * n[1] + turn[0][i][2] * n[2];
    const double x = normal[0], y = normal[1], z = normal[2];
    double u = 0, v = z, w = -y;
    if (!(std::fabs(x) < along_x)) u = -z, v = 0, w = x;
    const double length = std::sqrt(u * u + v * v + w * w);
    u /= length, v /= length, w /= length;
    const double world[3][3] = {{x, y, z}, {u, v, w}, {y * w - z * v, z * u - x * w, x * v - y * u}};
    for (int side = 0; side < 2; ++side)
        for (int a = 0; a < 3; ++a)
            for (int i = 0; i < 3; ++i)
                axes[side][a][i] =
                    world[a][0] * turn[side][0][i] + world[a][1] * turn[side][1][i] + world[a][2] * turn[side][2][i];
}

// Add axes times the shapes of a body's modes in a face to moves (3, modes or more).
void add_modes(const Body& body, const Face& face, const double (&weight)[3], const double (&axes)[3][3],
               const float* shapes, Array<double, 2> moves) {
    for (int corner = 0; corner < 3; ++corner) {
        const float* at = shapes + body.shape_at + 3 * face.vertex[corner] * body.columns;
        for (int i = 0; i < 3; ++i)
            for (int a = 0; a < 3; ++a) {
                const double factor = weight[corner] * axes[a][i];
                const float* along = at + i * body.columns;
                double* row = moves[a].data;
                for (int64_t m = 0; m < body.modes; ++m) row[m] += factor * static_cast<double>(along[m]);
            }
    }
}

// Write the six rigid motions behind the modes; turn: J^{−1/2}, by columns.
void write_rigid(const Body& body, const double (&point)[3], const double (&axes)[3][3], Array<const double, 2> turn,
                 Array<double, 2> moves) {
    const double x = point[0], y = point[1], z = point[2], root = std::sqrt(body.mass_kg);
    for (int a = 0; a < 3; ++a) {
        const double u = axes[a][0], v = axes[a][1], w = axes[a][2];
        const double lever[3] = {w * y - v * z, u * z - w * x, v * x - u * y};  // of axis u: r × u
        for (int i = 0; i < 3; ++i) {
            moves(a, body.modes + i) = axes[a][i] / root;
            moves(a, body.modes + 3 + i) = lever[0] * turn(0, i) + lever[1] * turn(1, i) + lever[2] * turn(2, i);
        }
    }
}

}  // namespace

double place_points(const BodyTables& tables, Array<const double, 2> quaternion, const ContactPatch& patch,
                    const int64_t (&both)[2], Array<const double, 3> turn, const Array<double, 3> (&moves)[2],
                    Doubles curvature_per_m) {
    double axes[2][3][3], farthest = 0;
    const int64_t count = patch.count;
    write_axes(quaternion, both, patch, axes);
    for (int side = 0; side < 2; ++side) {
        const Body& body = tables.bodies[both[side]];
        const double (&normal)[3] = patch.outward[side];
        double middle[3] = {};
        for (int64_t k = 0; k < count; ++k) {
            const double (&point)[3] = patch.point_m[k][side];
            for (int x = 0; x < 3; ++x) middle[x] += point[x];
            const auto [at, here_per_m] = nearest_curved_point(body, tables, point, normal);
            if (at.face >= 0)
                add_modes(body, tables.faces[body.face_at + at.face], at.barycentric, axes[side], tables.shapes.data,
                          moves[side][k]);
            curvature_per_m[k] += here_per_m;
            if (body.mass_kg > 0) write_rigid(body, point, axes[side], turn[side], moves[side][k]);
        }
        if (body.faces > 0 && count > 0) {
            for (double& x : middle) x /= static_cast<double>(count);
            farthest = std::max(farthest, nearest_curved_point(body, tables, middle, normal).at.distance_m);
        }
    }
    return farthest;
}

}  // namespace engine
