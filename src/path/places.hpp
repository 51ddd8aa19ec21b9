// Places of bodies that emit: where they are and were, and whether their histories reach far enough.
//
// A body has a chain of places, by when it came there. Its present position is the last. Those before it, from which it
// was teleported, stay until the last of their sound has arrived.
#pragma once

#include "sound_path.hpp"

namespace engine {

// Mark which bodies emit, find new places for those teleported in this step, and return what is in the way, a
// `PathStatus`: nothing of the sound has changed so far.
int64_t find_obstacle(int64_t step, int64_t n, const Emission& emission, const Course& course, const PathTables& path);

// Give body b the present place p; the one it had becomes a left one.
void move_body(int64_t step, const PathTables& path, int64_t b, int64_t p);

}  // namespace engine
