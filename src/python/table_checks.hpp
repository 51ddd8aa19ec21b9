// Checks of tables that several doors take: each a ValueError that names what is wrong.
#pragma once

#include "../groups.hpp"

namespace engine {

// Check that all that a tree names is there, once and below its own node, and no deeper than a search goes.
void check_tree(Array<const Face, 1> faces, Array<const Node, 1> nodes);

// Check that all that the rows of bodies name is in the other tables.
void check_table(const BodyTables& table);

}  // namespace engine
