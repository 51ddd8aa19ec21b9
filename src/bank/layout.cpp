#include "layout.hpp"

namespace engine {

template <class T>
static void at_least(std::vector<T>& values, int64_t count) {
    if (static_cast<int64_t>(values.size()) < count) values.resize(count);
}

void BankWork::make_room(int64_t bodies, int64_t drives, int64_t samples, int64_t columns) {
    const int64_t stride = samples + LANES;
    at_least(first, bodies + 1);
    at_least(side, 2 * drives);
    at_least(signal, 2 * drives * stride);
    at_least(axis_impulse, 6 * stride);
    at_least(lasting, columns);
}

}  // namespace engine
