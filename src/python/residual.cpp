// Python's door to src/residual.
#include "arrays.hpp"

namespace engine {

void bind_residual([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
