// Python's door to src/listener.
#include "arrays.hpp"

namespace engine {

void bind_listener([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
