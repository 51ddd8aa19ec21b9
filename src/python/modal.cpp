// Python's door to src/modal.
#include "arrays.hpp"

namespace engine {

void bind_modal([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
