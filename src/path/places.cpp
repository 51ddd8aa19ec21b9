#include "places.hpp"

#include <cmath>
#include <limits>

#include "fractional_delay.hpp"

namespace engine {

namespace {

// Test whether sound of the place is under way to any microphone.
bool is_awake(const PathTables& path, int64_t place) {
    const int64_t channels = path.microphone_m.shape[0];
    for (int64_t c = 0; c < channels; ++c)
        if (path.lines[place * channels + c].awake != 0) return true;
    return false;
}

// Test whether sound of a body's present or last place is under way to microphone c.
bool is_awake(const PathTables& path, const Source& body, int64_t c) {
    const int64_t channels = path.microphone_m.shape[0];
    if (body.leaving >= 0 && path.lines[body.leaving * channels + c].awake != 0) return true;
    return path.lines[body.main * channels + c].awake != 0;
}

// Find whether body b emits anything in the first weight set or one that a microphone hears, and whether it can be.
Loudness loudness_of(int64_t b, int64_t n, const Emission& emission) {
    const int64_t stride = emission.source.shape[2];
    const double* dipole = emission.dipole[b].data + emission.first;
    const auto of_set = [&](int64_t set) {
        return fractional_delay().loudness(emission.source[set][b].from(emission.first), dipole, stride, n);
    };
    Loudness found = of_set(0);
    for (int64_t c = 0; c < emission.sets.size(); ++c) {
        bool known = emission.sets[c] == 0;
        for (int64_t other = 0; other < c; ++other) known = known || emission.sets[other] == emission.sets[c];
        if (known) continue;
        const Loudness one = of_set(emission.sets[c]);
        found.any = found.any || one.any, found.finite = found.finite && one.finite;
    }
    return found;
}

struct EndSquares {
    double begin_m2, end_m2;
};

// Compute the square of the distance of body b from microphone c at the step's ends.
EndSquares end_squares(const Course& course, const Array<const double, 2>& microphone_m, int64_t b, int64_t c) {
    EndSquares found{0, 0};
    for (int axis = 0; axis < 3; ++axis) {
        const bool moves = course.aim_m.size() > 0;
        const double u = course.begin_m(b, axis) - (moves ? course.aim_m(0, b, c, axis) : microphone_m(c, axis));
        const double v = course.end_m(b, axis) - (moves ? course.aim_m(1, b, c, axis) : microphone_m(c, axis));
        found.begin_m2 += u * u;
        found.end_m2 += v * v;
    }
    return found;
}

// Return PATH_DONE, or what is wrong with a place that emits at the distance √square.
int64_t check_place(Place& place, Source& source, double square_m2, double samples_per_m) {
    constexpr int64_t margin =
        PATH_BLOCK + 64;  // samples remembered beyond the longest delay: a block is emitted before any of it is read
    const double away_m = std::sqrt(square_m2);
    if (!(away_m < std::numeric_limits<double>::infinity())) return NOT_FINITE;
    if (away_m > FARTHEST_M) {
        source.away_m = away_m;
        return TOO_FAR;
    }
    const int64_t need = static_cast<int64_t>(away_m * samples_per_m) + 1 + margin;
    if (need <= place.size) return PATH_DONE;
    place.need = need;
    return MEMORY_SHORT;
}

// Find the next place from p on that no sound comes from and no body needs; the number of places for none.
int64_t free_place(const PathTables& path, int64_t step, int64_t p) {
    for (; p < path.places.size(); ++p) {
        const int64_t b = path.places[p].body;
        if (b < 0) break;
        const Source& body = path.sources[b];
        const bool needed = p == body.main || (p == body.leaving && body.left == step);
        if (!needed && !is_awake(path, p)) break;
    }
    return p;
}

}  // namespace

// The distance of what emits is greatest at an end of the step. Silence needs no fade: a silent body keeps its place.
int64_t find_obstacle(int64_t step, int64_t n, const Emission& emission, const Course& course, const PathTables& path) {
    const int64_t channels = path.microphone_m.shape[0];
    int64_t free = 0, wrong = PATH_DONE;
    for (int64_t b = 0; b < path.sources.size(); ++b) {
        Source& body = path.sources[b];
        const Loudness loudness = loudness_of(b, n, emission);
        if (!loudness.finite) return NOT_FINITE;
        body.sounds = loudness.any, body.fresh = -1, body.away_m = 0;
        double start = 0, stop = 0;
        for (int64_t c = 0; c < channels; ++c) {
            if (course.gain.size() > 0 && course.gain(0, b, c) == 0 && course.gain(1, b, c) == 0 &&
                !is_awake(path, body, c))
                continue;
            const auto [begin_m2, end_m2] = end_squares(course, path.microphone_m, b, c);
            if (!(begin_m2 <= start)) start = begin_m2;  // what is not a number is kept
            if (!(end_m2 <= stop)) stop = end_m2;
        }
        int64_t main = body.main, old = -1;
        const bool observed = body.sounds == 1 || is_awake(path, main);
        if (body.left == step) {
            if (body.leaving >= 0 && (body.sounds == 1 || is_awake(path, body.leaving))) old = body.leaving;
        } else if (course.teleported[b] && observed) {
            old = main;
            main = free_place(path, step, free);
            if (main == path.places.size()) return PLACES_SHORT;
            body.fresh = main, free = main + 1;
        } else if (start > stop || !(start < std::numeric_limits<double>::infinity())) {
            stop = start;
        }
        if (observed) {
            const int64_t status = check_place(path.places[main], body, stop, path.samples_per_m);
            if (status > wrong) wrong = status;
        }
        if (old >= 0) {
            const int64_t status = check_place(path.places[old], body, start, path.samples_per_m);
            if (status > wrong) wrong = status;
        }
    }
    return wrong;
}

void move_body(int64_t step, const PathTables& path, int64_t b, int64_t p) {
    Place& place = path.places[p];
    if (place.body >= 0) {  // remove it from its former chain
        Source& old = path.sources[place.body];
        if (old.oldest == p) {
            old.oldest = place.next;
        } else {
            int64_t before = old.oldest;
            while (path.places[before].next != p) before = path.places[before].next;
            path.places[before].next = place.next;
        }
        if (old.leaving == p) old.leaving = -1;
    }
    Source& body = path.sources[b];
    place.body = b, place.next = -1;
    path.places[body.main].next = p;
    body.leaving = body.main, body.main = p, body.left = step;
}

}  // namespace engine
