// Python's door to src/signal.
#include "../signal/frames.hpp"
#include "arrays.hpp"

namespace engine {

void bind_signal(nb::module_& m) {
    m.def(
        "cut_frames",
        [](Array<const float, 1> sample, Array<const float, 1> window, int64_t hop, Array<float, 2> frames) {
            check_shape("frames", frames, frames.size(), window.size());
            check_range("hop", hop, 1, window.size() + 1);
            nb::gil_scoped_release released;
            cut_frames(sample, window, hop, frames);
        },
        "sample"_a, "window"_a, "hop"_a, "frames"_a,
        "Cut frames (m, N), hop samples apart, of samples under the window (N,); zeros outside.");
    m.def(
        "add_frames",
        [](Array<const float, 2> frames, Array<const float, 1> window, int64_t hop, Array<float, 1> sample) {
            check_shape("frames", frames, frames.size(), window.size());
            check_range("hop", hop, 1, window.size() + 1);
            nb::gil_scoped_release released;
            add_frames(frames, window, hop, sample);
        },
        "frames"_a, "window"_a, "hop"_a, "sample"_a,
        "Add frames (m, N) under the window to samples (n,), where they lie in them.");
}

}  // namespace engine
