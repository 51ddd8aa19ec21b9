#include "sound_path.hpp"

#include <algorithm>
#include <limits>

#include "fractional_delay.hpp"
#include "places.hpp"

namespace engine {

namespace {

// How what a place emits is faded over the step: a body's new place in, the one it left out; silent from now on: a
// place left before, of which sound is still under way.
enum class Fade { none, in, out, silent };

// Factors at a step's ends of what a body emits to a microphone.
struct EndGains {
    double begin, end;
};

// Fading, a body is at one place: the factor is that of its end of the step.
EndGains end_gains(const Array<const double, 3>& gain, int64_t b, int64_t c, Fade fade) {
    if (gain.size() == 0) return {1, 1};
    return {gain(fade == Fade::in ? 1 : 0, b, c), gain(fade == Fade::out ? 0 : 1, b, c)};
}

// A line over samples at … at + n - 1: from one place of body b to microphone c.
struct Route {
    Line& line;
    Ring ring;
    MovingSource source;  // from sample ``at`` on
    Fade fade;
    EndGains gain;
    int64_t place_size;
};

// Add what arrives by a route to out (n,).
void propagate(Route& route, int64_t at, int64_t n, KeptTaps& kept, LineBlock& block, double* out) {
    const FractionalDelay& vectors = fractional_delay();
    const TapPolynomials& taps = tap_polynomials();
    for (int64_t low = 0; low < n;) {  // a block that lies in one piece
        const int64_t count =
            std::min({route.place_size - ((at + low) & route.ring.mask), int64_t{PATH_BLOCK}, n - low});
        const bool steep = vectors.emit(route.source, count, block);
        const auto scale = [&](double begin, double end) {
            vectors.scale(block.emitted, begin, end, route.source.x, count);
        };
        if (route.fade == Fade::in) scale(0, 1);
        if (route.fade == Fade::out) scale(1, 0);
        if (route.fade == Fade::silent) scale(0, 0);
        if (route.gain.begin != 1 || route.gain.end != 1) scale(route.gain.begin, route.gain.end);
        if (vectors.listen(route.line, at + low, count, steep, route.ring, taps, kept, block))
            vectors.add(block.observed, out + low, count);
        route.source.pressure += count, route.source.x += count;
        for (const double*& along : route.source.dipole) along += count;
        low += count;
    }
}

}  // namespace

int64_t hear(int64_t at, int64_t step, int64_t n, const Emission& emission, const Course& course,
             const PathTables& path, const Arrivals& arrivals) {
    const int64_t status = find_obstacle(step, n, emission, course, path);
    if (status != PATH_DONE) return status;
    const int64_t channels = path.microphone_m.shape[0];
    const int64_t rows = channels * (arrivals.apart ? path.sources.size() : 1);
    for (int64_t row = 0; row < rows; ++row) set_zero(arrivals.out[row].data + arrivals.at, n);
    LineBlock block;
    KeptTaps kept;
    kept.t = std::numeric_limits<double>::quiet_NaN();
    for (int64_t b = 0; b < path.sources.size(); ++b) {
        Source& body = path.sources[b];
        if (body.fresh >= 0) {
            move_body(step, path, b, body.fresh);
            for (int axis = 0; axis < 3; ++axis) path.places[body.leaving].rest_m[axis] = course.begin_m(b, axis);
        }
        for (int64_t p = body.oldest; p >= 0; p = path.places[p].next) {
            const Place& place = path.places[p];
            const bool present = p == body.main, moved = body.left == step;
            const Fade fade =
                present ? (moved ? Fade::in : Fade::none) : (moved && p == body.leaving ? Fade::out : Fade::silent);
            for (int64_t c = 0; c < channels; ++c) {
                Line& line = path.lines[p * channels + c];
                const EndGains gain = end_gains(course.gain, b, c, fade);
                const bool quiet = fade == Fade::silent || body.sounds == 0 || (gain.begin == 0 && gain.end == 0);
                if (line.awake == 0 && quiet) continue;
                double* history = path.memory.data + place.memory_at + c * 2 * (place.size + MIRRORED);
                Route route{.line = line,
                            .ring = {history, history + place.size + MIRRORED, place.size - 1},
                            .source = {},
                            .fade = fade,
                            .gain = gain,
                            .place_size = place.size};
                MovingSource& source = route.source;
                source.pressure = emission.source[emission.sets[c]][b].from(emission.first);
                source.x = course.x.from(emission.first);
                source.samples_per_m = path.samples_per_m, source.most_per_m = 1 / body.radius_m;
                for (int axis = 0; axis < 3; ++axis) {
                    source.dipole[axis] = emission.dipole[b][axis].from(emission.first);
                    const double stop = present ? course.end_m(b, axis) : place.rest_m[axis];
                    const double start = fade == Fade::none ? course.begin_m(b, axis) : stop;
                    source.way_m[axis] = path.microphone_m(c, axis) - start, source.moved_m[axis] = stop - start;
                    if (course.aim_m.size() > 0) {
                        const double here = course.aim_m(0, b, c, axis), there = course.aim_m(1, b, c, axis);
                        source.way_m[axis] = here - start, source.moved_m[axis] = (stop - start) - (there - here);
                    }
                }
                const int64_t row = (arrivals.apart ? b * channels : 0) + c;
                propagate(route, at, n, kept, block, arrivals.out[row].data + arrivals.at);
            }
        }
    }
    for (int64_t row = 0; row < rows; ++row) fractional_delay().flush(arrivals.out[row].data + arrivals.at, n);
    return PATH_DONE;
}

}  // namespace engine
