// Checks of what `hear` takes, for each door that leads there.
#pragma once

#include "../path/sound_path.hpp"

namespace engine {

// Check shapes and every index of a path's tables: a ValueError that names what is wrong.
void check_path(const PathTables& path);

// Check that samples of a call lie within what is given and filled, for that path.
void check_sound(int64_t n, const Emission& emission, const Course& course, const PathTables& path,
                 const Arrivals& arrivals);

}  // namespace engine
