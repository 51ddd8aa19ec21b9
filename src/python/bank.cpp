// Python's door to src/bank.
#include "arrays.hpp"

namespace engine {

void bind_bank([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
