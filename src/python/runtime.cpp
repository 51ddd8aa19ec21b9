// Python's door to src/runtime.
#include "arrays.hpp"

namespace engine {

void bind_runtime([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
