// Python's door to src/path.
#include "arrays.hpp"

namespace engine {

void bind_path([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
