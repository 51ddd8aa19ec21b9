// Python's door to src/math.
#include "arrays.hpp"

namespace engine {

void bind_math([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
