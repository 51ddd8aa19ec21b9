#include <cmath>
#include <limits>

#include "../vector8_compare.hpp"
#include "fractional_delay.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

Loudness loudness(const double* source, const double* dipole, int64_t stride, int64_t count) {
    const int64_t whole = count & -LANES;
    const Double8 zero = broadcast(0.0);
    Double8 sum = zero;  // of 0·x: NaN once one of them is not finite
    Bits8 bits = bits_of(zero);
    for (int row = 0; row < 4; ++row) {
        const double* values = row == 0 ? source : dipole + (row - 1) * stride;
        for (int64_t k = 0; k < whole; k += LANES) {
            const Double8 some = load(values + k);
            sum = sum + some * zero;
            bits = bits | bits_of(some);
        }
        double rest[LANES] = {};
        for (int64_t k = whole; k < count; ++k) rest[k - whole] = values[k];
        sum = sum + load(rest) * zero;
        bits = bits | bits_of(load(rest));
    }
    int64_t lane[LANES], any = 0;
    std::memcpy(lane, &bits, sizeof lane);
    for (int k = 0; k < LANES; ++k) any |= lane[k];
    return {(any & std::numeric_limits<int64_t>::max()) != 0, total(sum) == 0.0};
}

VECTOR_INLINE Double8 greater(const Double8& a, const Double8& b) {
    return choose(b < a, a, b);
}

bool emit(const MovingSource& source, int64_t count, LineBlock& block) {
    Double8 way[3], moved[3];
    for (int axis = 0; axis < 3; ++axis)
        way[axis] = broadcast(source.way_m[axis]), moved[axis] = broadcast(source.moved_m[axis]);
    const Double8 samples_per_m = broadcast(source.samples_per_m), most = broadcast(source.most_per_m),
                  one = broadcast(1.0);
    double rest[5][LANES];  // what does not fill eight, its last repeated
    const int64_t whole = count & -LANES;
    for (int64_t k = whole; k < whole + LANES; ++k) {
        const int64_t at = k < count ? k : count - 1;
        rest[0][k - whole] = source.pressure[at], rest[4][k - whole] = source.x[at];
        for (int axis = 0; axis < 3; ++axis) rest[1 + axis][k - whole] = source.dipole[axis][at];
    }
    for (int64_t k = 0; k < count; k += LANES) {
        const bool last = k == whole;
        const Double8 x = load(last ? rest[4] : source.x + k);
        Double8 square = broadcast(0.0), dot = square;
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; ++axis) {
            const Double8 away = way[axis] - moved[axis] * x;
            square = square + away * away;
            dot = dot + away * load(last ? rest[1 + axis] : source.dipole[axis] + k);
        }
        const Double8 r = root(square);
        const Double8 inverse = one / greater(r, broadcast(1e-12));
        const Double8 fall = choose(inverse < most, inverse, most);
        const Double8 pressure = load(last ? rest[0] : source.pressure + k);
        store(block.emitted + k, flushed((dot * inverse + pressure) * fall));
        store(block.delay + k, greater(r * samples_per_m, broadcast(double{AHEAD})));
    }
    Bits8 falls = bits_of(broadcast(0.0));
    for (int64_t k = 1; k < count; k += LANES) {
        // the last group may reach behind what was computed, where it only asks for a check that finds nothing
        falls = falls | (load(block.delay + k) < load(block.delay + k - 1) - broadcast(MOST_FALL));
    }
    return lane_bits(falls) != 0;
}

// Find the last of emitted[start … stop - 1] that is not zero; ``none`` where all are.
int64_t newest_of(const double* emitted, int64_t start, int64_t stop, int64_t none) {
    int64_t i = stop - 1;
    while (i >= start && emitted[i] == 0.0) --i;
    return i >= start ? i : none;
}

// Find the first sample from i on at which the newest that is not zero has arrived, ``stop`` for none.
// behind: from a sample to the first that it is read from.
int64_t last_of(const double* emitted, int64_t i, int64_t stop, int64_t newest, int64_t behind) {
    for (; i < stop; ++i) {
        if (emitted[i] != 0.0) newest = i;
        if (i + behind > newest) break;
    }
    return i;
}

// Write samples at + start … at + n - 1, which lie in one piece, into a line's history.
// before: the delay before them; steep: delays fall faster than MOST_FALL.
void remember(const Ring& ring, int64_t at, int64_t start, int64_t n, const LineBlock& block, double before,
              bool steep) {
    const int64_t place = (at + start) & ring.mask, count = n - start;
    double *emitted = ring.emitted + place, *delay = ring.delay + place;
    std::memcpy(emitted, block.emitted + start, count * sizeof(double));
    std::memcpy(delay, block.delay + start, count * sizeof(double));
    if (steep || block.delay[start] < before - MOST_FALL)
        for (int64_t i = start; i < n; ++i) {
            before = block.delay[i] > before - MOST_FALL ? block.delay[i] : before - MOST_FALL;
            delay[i - start] = before;
        }
    const int64_t again = MIRRORED - place < count ? MIRRORED - place : count;
    if (again > 0) {
        std::memcpy(emitted + ring.mask + 1, emitted, again * sizeof(double));
        std::memcpy(delay + ring.mask + 1, delay, again * sizeof(double));
    }
}

// Fill the history before sample n with silence at that delay.
void wake(const Ring& ring, int64_t n, double delay) {
    constexpr int64_t history = 3 * AHEAD;
    for (int64_t k = n - history; k < n; ++k) {
        const int64_t place = k & ring.mask;
        ring.emitted[place] = 0.0, ring.delay[place] = delay;
        if (place < MIRRORED) ring.emitted[ring.mask + 1 + place] = 0.0, ring.delay[ring.mask + 1 + place] = delay;
    }
}

// Count how many of eight samples n, n + 1, … read m, m + 1, …, one sample of the history each.
// delay[k]: D[m + k]; gone: m - n.
VECTOR_INLINE int leading(const double* delay, int64_t gone) {
    const Double8 zero = broadcast(0.0);
    const Double8 here = broadcast(static_cast<double>(gone)) + load(delay);
    const Double8 there = broadcast(static_cast<double>(gone + 1)) + load(delay + 1);
    return __builtin_ctz(~lane_bits((here <= zero) & (zero < there)));
}

// Compute the taps of one t, as `read` does of eight.
void compute_taps(double t, const TapPolynomials& taps, KeptTaps& kept) {
    const Double8 square = broadcast(t) * broadcast(t);
    kept.t = t;
    for (int first = 0; first < AHEAD; first += LANES) {
        Double8 even = load(taps.power[HALF_DEGREE][0] + first), odd = load(taps.power[HALF_DEGREE][1] + first);
        for (int power = HALF_DEGREE - 1; power >= 0; --power) {
            even = even * square + load(taps.power[power][0] + first);
            odd = odd * square + load(taps.power[power][1] + first);
        }
        odd = odd * broadcast(t);
        double low[LANES], high[LANES];
        store(low, even + odd), store(high, even - odd);
        for (int k = first; k < first + LANES && k < AHEAD; ++k)
            kept.tap[k] = low[k - first], kept.tap[TAPS - 1 - k] = high[k - first];
    }
}

// Compute Σ_k a[m - 11 + k] h_k of eight samples as in `leading` into observed. emitted[k]: a[m - 11 + k].
VECTOR_INLINE void read(const double* emitted, const double* delay, int64_t gone, const TapPolynomials& taps,
                        KeptTaps& kept, double* observed) {
    const Double8 here = load(delay), there = load(delay + 1);
    const Double8 since = broadcast(static_cast<double>(-gone)) - here;
    const Double8 t = since / (broadcast(1.0) + there - here) - broadcast(0.5);
    Double8 low = broadcast(0.0), high = low;  // both halves, from the outer taps to the inner
    const double one = first_lane(t);
    if (all_lanes(t == broadcast(one))) {
        if (one != kept.t) compute_taps(one, taps, kept);
#pragma GCC unroll 12
        for (int k = 0; k < AHEAD; ++k) {
            low = low + broadcast(kept.tap[k]) * load(emitted + k);
            high = high + broadcast(kept.tap[TAPS - 1 - k]) * load(emitted + TAPS - 1 - k);
        }
        store(observed, low + high);
        return;
    }
    const Double8 square = t * t;
#pragma GCC unroll 12
    for (int k = 0; k < AHEAD; ++k) {
        Double8 even = broadcast(taps.power[HALF_DEGREE][0][k]), odd = broadcast(taps.power[HALF_DEGREE][1][k]);
#pragma GCC unroll 4
        for (int power = HALF_DEGREE - 1; power >= 0; --power) {
            even = even * square + broadcast(taps.power[power][0][k]);
            odd = odd * square + broadcast(taps.power[power][1][k]);
        }
        odd = odd * t;
        low = low + (even + odd) * load(emitted + k);
        high = high + (even - odd) * load(emitted + TAPS - 1 - k);
    }
    store(observed, low + high);
}

bool listen(Line& line, int64_t at, int64_t n, bool steep, const Ring& ring, const TapPolynomials& taps, KeptTaps& kept,
            LineBlock& block) {
    const double* emitted = block.emitted;
    const int64_t mask = ring.mask;
    bool awake = line.awake != 0, arrives = false, waits = true;
    int64_t m = line.cursor - at, newest = line.newest - at, i = 0;  // counted from ``at``
    if (awake) remember(ring, at, 0, n, block, ring.delay[(at - 1) & mask], steep);
    while (i < n) {
        if (!awake) {
            while (i < n && emitted[i] == 0.0) ++i;
            if (i == n) break;
            awake = waits = true;
            m = i - AHEAD - 1, newest = i;
            wake(ring, at + i, block.delay[i]);
            remember(ring, at, i, n, block, -std::numeric_limits<double>::infinity(), steep);
        }
        if (waits) {
            waits = false;
            int64_t begin = m + static_cast<int64_t>(std::ceil(ring.delay[(at + m) & mask]));
            if (begin > i) {  // none of it has arrived yet
                if (begin > n) begin = n;
                newest = newest_of(emitted, i, begin, newest);
                i = begin;
                continue;
            }
        }
        if (!arrives) {
            arrives = true;
            std::memset(block.observed, 0, n * sizeof(double));
        }
        int64_t base = m + 1;  // usual case: a whole group, one sample further
        int count = leading(ring.delay + ((at + base) & mask), base - i);
        if (count == 0) {
            base = m;
            while (static_cast<double>(base + 1 - i) + ring.delay[(at + base + 1) & mask] <= 0.0) ++base;
            count = leading(ring.delay + ((at + base) & mask), base - i);
        }
        read(ring.emitted + ((at + base + 1 - AHEAD) & mask), ring.delay + ((at + base) & mask), base - i, taps, kept,
             block.observed + i);
        if (count == LANES && i + LANES <= n && newest >= i - LANES && emitted[i + LANES - 1] != 0.0) {
            newest = i + LANES - 1;
            i += LANES, m = base + LANES - 1;
            continue;
        }
        const int64_t stop = i + count < n ? i + count : n;
        const int64_t last = last_of(emitted, i, stop, newest, base - (AHEAD - 1) - i);
        awake = last == stop;
        newest = newest_of(emitted, i, last, newest);
        m = base + last - 1 - i, i = last;
        if (!awake) {
            store(block.observed + i, broadcast(0.0));
            ++i;
        }
    }
    line.awake = awake, line.cursor = at + m, line.newest = at + newest;
    return arrives;
}

void scale(double* emitted, double begin, double end, const double* x, int64_t count) {
    const Double8 first = broadcast(begin), rise = broadcast(end - begin);
    const int64_t whole = count & -LANES;
    for (int64_t k = 0; k < whole; k += LANES)
        store(emitted + k, flushed(load(emitted + k) * (first + rise * load(x + k))));
    for (int64_t k = whole; k < count; ++k) emitted[k] = flushed(emitted[k] * (begin + (end - begin) * x[k]));
}

void add(const double* values, double* out, int64_t count) {
    const int64_t whole = count & -LANES;
    for (int64_t k = 0; k < whole; k += LANES) store(out + k, load(out + k) + load(values + k));
    for (int64_t k = whole; k < count; ++k) out[k] += values[k];
}

void flush(double* out, int64_t count) {
    const int64_t whole = count & -LANES;
    for (int64_t k = 0; k < whole; k += LANES) store(out + k, flushed(load(out + k)));
    for (int64_t k = whole; k < count; ++k) out[k] = flushed(out[k]);
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(FractionalDelay, fractional_delay) = {VECTOR_LEVEL::loudness, VECTOR_LEVEL::emit, VECTOR_LEVEL::listen,
                                                   VECTOR_LEVEL::scale,    VECTOR_LEVEL::add,  VECTOR_LEVEL::flush};

}  // namespace engine
