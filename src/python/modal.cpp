// Python's door to src/modal.
#include "../modal/mode_shapes.hpp"
#include "../modal/packed_triangle.hpp"
#include "../modal/winding_number.hpp"
#include "arrays.hpp"

namespace engine {

void bind_modal(nb::module_& m) {
    m.attr("DIPOLE_FACES") = DIPOLE_FACES;
    m.attr("DIPOLE_GROUPS") = DIPOLE_GROUPS;
    m.def(
        "pack_triangle",
        [](Array<const double, 2> matrix, Doubles packed) {
            const int64_t size = matrix.size();
            check_shape("matrix", matrix, size, size);
            check_shape("packed", packed, size * (size + 1) / 2);
            nb::gil_scoped_release released;
            pack_triangle(matrix, packed);
        },
        "matrix"_a, "packed"_a, "Pack the rows of an upper triangle (c, c) one after the other.");
    m.def(
        "add_triangle",
        [](Array<const double, 1> packed, Array<const int64_t, 1> place, Array<double, 2> column,
           Array<double, 2> rest) {
            const int64_t count = place.size(), width = column.size(), all = column.shape[1];
            check_shape("packed", packed, count * (count + 1) / 2);
            check_shape("rest", rest, all - width, all - width);
            for (int64_t i = 0; i < count; ++i) check_range("place", place[i], i > 0 ? place[i - 1] + 1 : 0, all);
            nb::gil_scoped_release released;
            add_triangle(packed, place, column, rest);
        },
        "packed"_a, "place"_a, "column"_a, "rest"_a,
        "Add a packed triangle of c rows at its places (c,) among the columns of its parent: column (w, n) and\n"
        "rest (n - w, n - w), transposed.");
    m.def(
        "round_shapes",
        [](Array<float, 2> shape, int bits) {
            check_range("bits", bits, 1, 21);
            nb::gil_scoped_release released;
            round_shapes(shape, bits);
        },
        "shape"_a, "bits"_a, "Round shapes (n, m) of n components to whole multiples of each mode's power of two.");
    m.def(
        "find_largest_motions",
        [](Array<const float, 3> shape, Doubles largest) {
            check_shape("shape", shape, shape.size(), 3, largest.size());
            nb::gil_scoped_release released;
            find_largest_motions(shape, largest);
        },
        "shape"_a, "largest"_a, "Fill the largest size (m,) over the vertices of shapes (v, 3, m).");
    m.def(
        "winding_numbers",
        [](Array<const double, 3> corner_m, Array<const double, 2> group, Array<const int64_t, 1> first,
           Array<const double, 2> point_m, Doubles winding) {
            check_shape("corner_m", corner_m, corner_m.size(), 3, 3);
            check_shape("group", group, group.size(), 7);
            check_shape("point_m", point_m, point_m.size(), 3);
            check_shape("winding", winding, point_m.size());
            const int64_t levels = first.size() - 1;
            check_range("levels", levels, 1, DIPOLE_LEVELS + 1);
            int64_t below = corner_m.size(), members = DIPOLE_FACES;
            for (int64_t level = 0; level < levels; ++level) {  // as many groups as what is below needs
                const int64_t count = (below + members - 1) / members;
                check_range("first", first[level + 1] - first[level], count, count + 1);
                below = count, members = DIPOLE_GROUPS;
            }
            check_range("first", first[0], 0, 1);
            check_range("first", first[levels], group.size(), group.size() + 1);
            check_range("groups of the last level", below, 0, DIPOLE_GROUPS + 1);
            nb::gil_scoped_release released;
            winding_numbers(corner_m, group, first, point_m, winding);
        },
        "corner_m"_a, "group"_a, "first"_a, "point_m"_a, "winding"_a,
        "Compute how often a surface winds round each point (k, 3).");
}

}  // namespace engine
