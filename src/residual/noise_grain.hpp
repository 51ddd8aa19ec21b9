// Noise of a strike beside its modes: base grains filtered to a place, and mixed to a new one for each strike.
#pragma once

#include "../array.hpp"
#include "../math/elementary.hpp"

namespace engine {

// Fill step (p,) with levels of power (p,) below the most, in whole steps of so many dB, no lower than -60 dB.
void count_level_steps(Array<const double, 1> power, double most, double step_db, Array<std::int16_t, 1> step);

// Fill mixed (n,) with first·grains[0] + second·grains[1].
void mix_grains(Array<const float, 2> grains, float first, float second, Array<float, 1> mixed);

// Fill filtered (v, F) with base·gain, the gain (k,) linear between its bins.
void filter_grains(Array<const ComplexFloat, 2> base, Array<const float, 1> gain, Array<ComplexFloat, 2> filtered);

// Multiply a spectrum (F,) by first·base_0 + second·base_1, first and second (k,) linear between their bins.
void shape_spectrum(Array<ComplexFloat, 1> spectrum, Array<const ComplexFloat, 2> base, Array<const float, 1> first,
                    Array<const float, 1> second);

}  // namespace engine
