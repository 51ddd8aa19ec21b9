#include "stable_order.hpp"

#include <algorithm>
#include <utility>

namespace engine {

Integers stable_order(Array<const int64_t, 1> key, Integers order, Integers other) {
    const int64_t count = key.size();
    for (int64_t i = 0; i < count; ++i) order[i] = i;
    for (int64_t width = 1; width < count; width *= 2) {  // merged pairwise, from single ones on
        for (int64_t start = 0; start < count; start += 2 * width) {
            const int64_t middle = std::min(start + width, count), stop = std::min(start + 2 * width, count);
            int64_t i = start, j = middle;
            for (int64_t place = start; place < stop; ++place) {
                const bool first = j >= stop || (i < middle && key[order[i]] <= key[order[j]]);
                other[place] = order[first ? i++ : j++];
            }
        }
        std::swap(order, other);
    }
    return order;
}

}  // namespace engine
