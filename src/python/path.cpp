// Python's door to src/path.
#include <vector>

#include "../path/ambisonics.hpp"
#include "../path/ear_filters.hpp"
#include "../path/filters.hpp"
#include "../path/fractional_delay.hpp"
#include "../path/image_gains.hpp"
#include "../path/sound_path.hpp"
#include "arrays.hpp"
#include "path_checks.hpp"

namespace engine {

void check_path(const PathTables& path) {
    const int64_t channels = path.microphone_m.shape[0], bodies = path.sources.size(), places = path.places.size();
    check_shape("microphone_m", path.microphone_m, channels, 3);
    check_shape("lines", path.lines, places * channels);
    for (int64_t p = 0; p < places; ++p) {
        const Place& place = path.places[p];
        check_range("body of a place", place.body, -1, bodies);
        check_range("next of a place", place.next, -1, places);
        check_range("size of a place", place.size, 2 * PATH_BLOCK, int64_t{1} << 40);
        if ((place.size & (place.size - 1)) != 0) throw nb::value_error("size of a place: not a power of two");
        check_range("memory of a place", place.memory_at, 0,
                    path.memory.size() + 1 - channels * 2 * (place.size + MIRRORED));
    }
    for (int64_t b = 0; b < bodies; ++b) {
        const Source& body = path.sources[b];
        check_range("main place of a body", body.main, 0, places);
        check_range("oldest place of a body", body.oldest, 0, places);
        check_range("left place of a body", body.leaving, -1, places);
        int64_t p = body.oldest;  // its chain ends at its present place
        for (int64_t count = 0; p != body.main; ++count) {
            if (count == places || path.places[p].body != b) throw nb::value_error("places of a body: not a chain");
            p = path.places[p].next;
            check_range("next of a body's place", p, 0, places);
        }
        if (path.places[p].next != -1) throw nb::value_error("places of a body: its present one is not the last");
    }
}

void check_sound(int64_t n, const Emission& emission, const Course& course, const PathTables& path,
                 const Arrivals& arrivals) {
    const int64_t channels = path.microphone_m.shape[0], bodies = path.sources.size();
    const auto at_least = [](const char* name, int64_t length, int64_t least) {
        if (length < least)
            throw nb::value_error(
                (std::string(name) + ": " + std::to_string(length) + ", not " + std::to_string(least) + " at least")
                    .c_str());
    };
    at_least("samples", n, 0);
    at_least("first", emission.first, 0);
    check_shape("dipole", emission.dipole, emission.dipole.shape[0], 3, emission.source.shape[2]);
    at_least("bodies of source", emission.source.shape[1], bodies);
    at_least("bodies of dipole", emission.dipole.shape[0], bodies);
    at_least("samples of source", emission.source.shape[2], emission.first + n);
    check_shape("sets", emission.sets, channels);
    for (int64_t c = 0; c < channels; ++c) check_range("set", emission.sets[c], 0, emission.source.shape[0]);
    check_shape("begin_m", course.begin_m, course.begin_m.shape[0], 3);
    check_shape("end_m", course.end_m, course.end_m.shape[0], 3);
    at_least("begin_m", course.begin_m.shape[0], bodies);
    at_least("end_m", course.end_m.shape[0], bodies);
    at_least("teleported", course.teleported.size(), bodies);
    at_least("x", course.x.size(), emission.first + n);
    if (course.aim_m.size() > 0) {
        check_shape("aim_m", course.aim_m, 2, course.aim_m.shape[1], channels, 3);
        at_least("bodies of aim_m", course.aim_m.shape[1], bodies);
    }
    if (course.gain.size() > 0) {
        check_shape("gain", course.gain, 2, course.gain.shape[1], channels);
        at_least("bodies of gain", course.gain.shape[1], bodies);
    }
    at_least("at", arrivals.at, 0);
    at_least("rows of out", arrivals.out.shape[0], channels * (arrivals.apart ? bodies : 1));
    at_least("samples of out", arrivals.out.shape[1], arrivals.at + n);
}

// Check the steps of a call: each within the samples (n,).
static void check_steps(Array<const int64_t, 1> first, Array<const int64_t, 1> count, int64_t n) {
    check_shape("count", count, first.size());
    for (int64_t k = 0; k < first.size(); ++k) {
        check_range("first", first[k], 0, n + 1);
        check_range("count", count[k], 0, n - first[k] + 1);
    }
}

static void check_images(const ImageScene& scene, const Array<const double, 4>& aim_m,
                         const Array<const double, 2>& microphone_m, const Array<double, 3>& gain) {
    const int64_t channels = microphone_m.shape[0], bodies = scene.position_m[0].shape[0];
    check_shape("images", scene.images, channels);
    check_shape("microphone_m", microphone_m, channels, 3);
    check_shape("has_image", scene.has_image, bodies);
    for (int end = 0; end < 2; ++end) {
        check_shape("position_m", scene.position_m[end], bodies, 3);
        check_shape("quaternion_xyzw", scene.quaternion_xyzw[end], bodies, 4);
    }
    for (int64_t c = 0; c < channels; ++c)
        if (scene.images[c].active == 1) check_range("owner", scene.images[c].owner, 0, bodies);
    if (aim_m.size() > 0) check_shape("aim_m", aim_m, 2, bodies, channels, 3);
    check_shape("gain", gain, 2, bodies, channels);
}

void bind_path(nb::module_& m) {
    add_dtype<Source>(m, "SOURCE");
    add_dtype<Place>(m, "PLACE");
    add_dtype<Line>(m, "LINE");
    add_dtype<Image>(m, "IMAGE");
    m.attr("TAPS") = TAPS;
    m.attr("MIRRORED") = MIRRORED;
    m.attr("HALF_DEGREE") = HALF_DEGREE;
    m.attr("FARTHEST_M") = FARTHEST_M;
    m.attr("PATH_DONE") = static_cast<int64_t>(PATH_DONE);
    m.attr("MEMORY_SHORT") = static_cast<int64_t>(MEMORY_SHORT);
    m.attr("PLACES_SHORT") = static_cast<int64_t>(PLACES_SHORT);
    m.attr("TOO_FAR") = static_cast<int64_t>(TOO_FAR);
    m.attr("NOT_FINITE") = static_cast<int64_t>(NOT_FINITE);
    m.def(
        "tap_polynomials",
        [](Array<double, 3> out) {
            check_shape("out", out, HALF_DEGREE + 1, 2, AHEAD);
            for (int power = 0; power <= HALF_DEGREE; ++power)
                for (int part = 0; part < 2; ++part)
                    for (int k = 0; k < AHEAD; ++k) out(power, part, k) = tap_polynomials().power[power][part][k];
        },
        "out"_a,
        "Fill out (HALF_DEGREE + 1, 2, TAPS/2) with polynomials in (fraction - 1/2)^2, lowest power first, of the "
        "even\n"
        "and odd parts of the interpolation's taps.");
    m.def(
        "hear",
        [](int64_t at, int64_t step, int64_t n, const Emission& emission, const Course& course, const PathTables& path,
           const Arrivals& arrivals) {
            check_path(path);
            check_sound(n, emission, course, path, arrivals);
            nb::gil_scoped_release released;
            return hear(at, step, n, emission, course, path, arrivals);
        },
        "at"_a, "step"_a, "n"_a, "emission"_a, "course"_a, "path"_a, "arrivals"_a,
        "Compute the pressure (Pa) at samples at … at + n - 1 of a step into an Arrivals; the path's tables are "
        "changed\n"
        "in place. Returns PATH_DONE, or what is in the way.");
    m.def(
        "image_gains",
        [](Array<const Image, 1> images, Array<const int64_t, 1> has_image, Array<const double, 2> begin_m,
           Array<const double, 2> end_m, Array<const double, 2> begin_xyzw, Array<const double, 2> end_xyzw,
           Array<const double, 4> aim_m, Array<const double, 2> microphone_m, Array<double, 3> gain) {
            const ImageScene scene{images, has_image, {begin_m, end_m}, {begin_xyzw, end_xyzw}};
            check_images(scene, aim_m, microphone_m, gain);
            nb::gil_scoped_release released;
            image_gains(scene, aim_m, microphone_m, gain);
        },
        "images"_a, "has_image"_a, "begin_m"_a, "end_m"_a, "begin_xyzw"_a, "end_xyzw"_a, "aim_m"_a, "microphone_m"_a,
        "gain"_a, "Compute how loud each body's image is at each microphone's, gain (2, b, c) at both ends of a step.");
    m.def(
        "spherical_harmonics",
        [](Array<const double, 1> direction, int64_t order, Array<double, 1> out) {
            check_shape("direction", direction, 3);
            check_range("order", order, 1, MOST_ORDER + 1);
            check_shape("out", out, (order + 1) * (order + 1));
            spherical_harmonics(direction[0], direction[1], direction[2], order, out.data);
        },
        "direction"_a, "order"_a, "out"_a,
        "Evaluate the harmonics of a direction (3,), of any length, into out ((order + 1)²,), ACN and SN3D.");
    m.def(
        "encode_ambisonics",
        [](Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
           Array<const double, 2> pressure, Array<const double, 3> away, int64_t order, Array<double, 3> out,
           bool apart) {
            const int64_t bodies = pressure.shape[0], n = pressure.shape[1];
            check_steps(first, count, n);
            check_shape("along", along, n);
            check_shape("away", away, first.size() + 1, bodies, 3);
            check_range("order", order, 1, MOST_ORDER + 1);
            check_shape("out", out, apart ? bodies : 1, (order + 1) * (order + 1), n);
            nb::gil_scoped_release released;
            encode_ambisonics(first, count, along, pressure, away, order, out, apart);
        },
        "first"_a, "count"_a, "along"_a, "pressure"_a, "away"_a, "order"_a, "out"_a, "apart"_a,
        "Add what bodies send, pressure (b, n), to out (1, i, n), or apart: (b, i, n).");
    m.def(
        "filter_ears",
        [](Array<const int64_t, 1> first, Array<const int64_t, 1> count, Array<const double, 1> along,
           Array<const double, 2> pressure, Array<double, 2> past, Array<const double, 4> response,
           Array<double, 3> out, bool apart) {
            const int64_t bodies = pressure.shape[0], n = pressure.shape[1], taps = response.shape[3];
            check_steps(first, count, n);
            check_range("taps", taps, 1, int64_t{1} << 40);
            check_shape("along", along, n);
            check_shape("past", past, bodies, taps - 1);
            check_shape("response", response, first.size() + 1, bodies, 2, taps);
            check_shape("out", out, apart ? bodies : 1, 2, n);
            std::vector<double> scratch(taps - 1 + n);
            nb::gil_scoped_release released;
            filter_ears(first, count, along, pressure, past, response, out, apart,
                        {scratch.data(), {static_cast<int64_t>(scratch.size())}});
        },
        "first"_a, "count"_a, "along"_a, "pressure"_a, "past"_a, "response"_a, "out"_a, "apart"_a,
        "Add what bodies send, pressure (b, n), through filters (k + 1, b, 2, t) to out (1, 2, n), or apart: (b, 2, "
        "n).");
    m.def(
        "filter_rows",
        [](Array<const double, 1> taps, Array<const double, 2> signal, Array<double, 2> out) {
            check_range("taps", taps.size(), 1, int64_t{1} << 40);
            check_shape("signal", signal, out.shape[0], taps.size() - 1 + out.shape[1]);
            nb::gil_scoped_release released;
            filter_rows(taps, signal, out);
        },
        "taps"_a, "signal"_a, "out"_a, "Add to out (g, n) what taps (t,) make of signal (g, t - 1 + n).");
}

}  // namespace engine
