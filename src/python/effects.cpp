// Python's door to src/effects.
#include "arrays.hpp"

namespace engine {

void bind_effects([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
