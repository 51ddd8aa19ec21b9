// Python's door to src/signal.
#include "arrays.hpp"

namespace engine {

void bind_signal([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
