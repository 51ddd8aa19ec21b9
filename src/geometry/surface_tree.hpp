// A balanced tree over the boxes of a surface's faces, for nearest_point.
//
//     boxes low, high, and centres (f, 3) -> order of the faces, nodes level by level
//
// Each node's faces are split at the median along the axis on which their centres lie farthest apart, in their present
// order where they are equal; a leaf holds up to four.
#pragma once

#include "../tables.hpp"

namespace engine {

// Fill order (f,) and nodes, room for f of them; return how many there are. f above 0, numbers finite.
int64_t grow_tree(Array<const double, 2> low, Array<const double, 2> high, Array<const double, 2> centre,
                  Integers order, Array<Node, 1> nodes);

}  // namespace engine
