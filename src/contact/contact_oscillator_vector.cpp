#include "contact_oscillator_vector.hpp"

#include "../vector8_compare.hpp"

namespace engine {
namespace VECTOR_LEVEL {

static VECTOR_INLINE Double8 larger(const Double8& a, const Double8& b) {
    return choose(b < a, a, b);
}

static VECTOR_INLINE Double8 negative(Double8 value) {
    for (int i = 0; i < PARTS; ++i) value.part[i] = -value.part[i];
    return value;
}

// Compute Hertz' force min(δ, 1)^(3/2) + 1.5(δ - 1)₊.
static VECTOR_INLINE Double8 hertz_force(const Double8& depth) {
    const Double8 one = broadcast(1.0), low = choose(depth < one, depth, one);
    return low * root(low) + broadcast(1.5) * (depth - low);
}

static VECTOR_INLINE Bits8 within(const Double8& value, const Double8& bound) {
    return (value <= bound) & (negative(bound) <= value);
}

static void oscillate(OscillatorLanes& lanes, const double* x, int64_t count, double* rate, int64_t length) {
    // below this fraction of the resting penetration, on surfaces that do not sweep, the contact is at rest
    constexpr double rests_below = 1e-9;
    const Double8 none = broadcast(0.0), one = broadcast(1.0), two_thirds = broadcast(2.0 / 3.0);
    const Double8 rest = load(lanes.rest_depth), rest_growth = load(lanes.rest_growth);
    const Double8 damping = load(lanes.damping), damping_growth = load(lanes.damping_growth);
    const Double8 rate_unit = load(lanes.rate_unit), substeps = load(lanes.substeps);
    const Double8 unit_n = load(lanes.force_unit_n) / substeps;
    const Bits8 still = load(lanes.still) == one;
    Double8 z = load(lanes.depth), u = load(lanes.separation_speed);
    for (int64_t i = 0; i < count; ++i) {
        double lane_rate[LANES];
        for (int lane = 0; lane < LANES; ++lane) lane_rate[lane] = rate[lane * length + i];
        const Double8 dh = load(lane_rate) * rate_unit, fraction = broadcast(x[i]);
        const Double8 d0 = rest + rest_growth * fraction, c = damping + damping_growth * fraction;
        const Double8 load_n = hertz_force(d0);
        Double8 sum = none;
        for (int64_t k = 0; k < lanes.most_substeps; ++k) {
            const Bits8 runs = broadcast(static_cast<double>(k)) < substeps;
            const Double8 moved = z + (dh - u);
            const Double8 elastic = hertz_force(larger(d0 + moved, none));
            const Double8 loss = elastic * c;
            // f - N with the damping implicit in u: f = elastic·(1 + c(dh/dt - u_new)), u_new = u + 2/3 (f - N);
            // exactly 0 at rest
            Double8 f = elastic - load_n + loss * (dh - u);
            f = f / (one + two_thirds * loss);
            f = choose(runs, larger(f, negative(load_n)), none);
            z = choose(runs, moved, z);
            u = u + two_thirds * f;
            sum = sum + f;
        }
        const Double8 bound = broadcast(rests_below) * d0;
        const Bits8 rests = still & within(z, bound) & within(u, bound);
        z = choose(rests, none, z), u = choose(rests, none, u), sum = choose(rests, none, sum);
        store(lane_rate, sum * unit_n);
        for (int lane = 0; lane < LANES; ++lane) rate[lane * length + i] = lane_rate[lane];
    }
    store(lanes.depth, z), store(lanes.separation_speed, u);
}

}  // namespace VECTOR_LEVEL

VECTOR_TABLE(OscillatorVector, oscillator_vector) = {VECTOR_LEVEL::oscillate};

}  // namespace engine
