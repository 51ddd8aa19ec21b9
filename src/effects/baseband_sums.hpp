// Running sums of a recording against three exponentials near a line's frequency, from which a Hann window's output at
// any sample is a difference [Harris 1978, eq. 27]:
//
//     s_a(n) = Σ_{m < n} y(m) e^{−i(ω − aθ)m},   a = −1, 0, 1
#pragma once

#include "../array.hpp"
#include "../math/elementary.hpp"

namespace engine {

// Fill sums (3, n + 1) of the samples (n,). omega and theta in rad a sample.
void sum_baseband(Array<const double, 1> sample, double omega, double theta, Array<Complex, 2> sums);

}  // namespace engine
