// The order of integer keys, equal ones as they stand, in memory that is given.
#pragma once

#include "../array.hpp"

namespace engine {

// Return the places of keys (n,) in ascending order: one of two memories (n,), whose contents are lost.
Integers stable_order(Array<const int64_t, 1> key, Integers order, Integers other);

}  // namespace engine
