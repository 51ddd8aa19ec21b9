// Python's door to src/contact.
#include "arrays.hpp"

namespace engine {

void bind_contact([[maybe_unused]] nb::module_& m) {}

}  // namespace engine
