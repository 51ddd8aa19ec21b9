// Python's door to src/geometry.
#include <vector>

#include "../geometry/nearest_point.hpp"
#include "../geometry/surface_tree.hpp"
#include "arrays.hpp"
#include "table_checks.hpp"

namespace engine {

void check_tree(Array<const Face, 1> faces, Array<const Node, 1> nodes) {
    if (nodes.size() == 0) throw nb::value_error("nodes: none");
    std::vector<int64_t> level{0};  // of each node that was named so far, -1 between them
    for (int64_t i = 0; i < static_cast<int64_t>(level.size()); ++i) {
        if (level[i] < 0) continue;
        const int64_t (&child)[2] = nodes[i].child;
        if (child[0] < 0) {
            check_range("face", -(child[0] + 1), 0, faces.size() + 1);
            check_range("face", child[1], -(child[0] + 1), faces.size() + 1);
            continue;
        }
        check_range("level of a node with children", level[i], 0, DEEPEST - 1);
        for (const int64_t at : child) {
            check_range("child", at, i + 1, nodes.size());
            if (at >= static_cast<int64_t>(level.size())) level.resize(at + 1, -1);
            if (level[at] >= 0) throw nb::value_error("child: a node has two parents");
            level[at] = level[i] + 1;
        }
    }
}

void bind_geometry(nb::module_& m) {
    add_dtype<Face>(m, "FACE");
    add_dtype<Node>(m, "NODE");
    m.def(
        "grow_tree",
        [](Array<const double, 2> low, Array<const double, 2> high, Array<const double, 2> centre, Integers order,
           Array<Node, 1> nodes) {
            const int64_t faces = order.size();
            check_range("faces", faces, 1, INT64_MAX);
            for (const auto& boxes : {low, high, centre}) check_shape("boxes", boxes, faces, 3);
            check_shape("nodes", nodes, faces);
            nb::gil_scoped_release released;
            return grow_tree(low, high, centre, order, nodes);
        },
        "low"_a, "high"_a, "centre"_a, "order"_a, "nodes"_a,
        "Build a balanced tree over boxes (f, 3): order (f,) of the faces and nodes (f,); return how many there are.");
    m.def(
        "nearest_points",
        [](Array<const Face, 1> faces, Array<const Node, 1> nodes, double wall_m, double tie_m,
           Array<const double, 2> point_m, Array<const double, 2> outward, Integers face, Array<double, 2> found) {
            check_tree(faces, nodes);
            check_shape("outward", outward, point_m.shape[0], 3);
            check_shape("point_m", point_m, point_m.shape[0], 3);
            check_shape("face", face, point_m.shape[0]);
            check_shape("found", found, point_m.shape[0], 4);
            nb::gil_scoped_release released;
            const Surface surface{faces.data, nodes.data, wall_m, tie_m};
            for (int64_t k = 0; k < point_m.shape[0]; ++k) {
                const SurfacePoint at = nearest_point(surface, point_m[k].data, outward[k].data);
                face[k] = at.face;
                for (int i = 0; i < 3; ++i) found(k, i) = at.barycentric[i];
                found(k, 3) = at.distance_m;
            }
        },
        "faces"_a, "nodes"_a, "wall_m"_a, "tie_m"_a, "point_m"_a, "outward"_a, "face"_a, "found"_a,
        "Find the points of a surface nearest to points (k, 3) with normals (k, 3), 0 for any: face (k,) and found\n"
        "(k, 4), barycentric coordinates and distance.");
}

}  // namespace engine
