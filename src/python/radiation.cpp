// Python's door to src/radiation.
#include "arrays.hpp"

namespace engine {

void bind_radiation([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
