#include "filters.hpp"

namespace engine {

void filter_rows(Array<const double, 1> taps, Array<const double, 2> signal, Array<double, 2> out) {
    for (int64_t g = 0; g < out.shape[0]; ++g)
        filters().filter(taps.data, taps.size(), signal[g].data, out[g].data, out.shape[1]);
}

}  // namespace engine
