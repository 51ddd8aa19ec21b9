#include "frames.hpp"

#include <algorithm>

namespace engine {

namespace {

// The part of frame m that lies within count samples: low … high - 1 of it, and the sample of its element 0.
struct Part {
    int64_t first, low, high;
};

Part within(int64_t m, int64_t hop, int64_t size, int64_t count) {
    const int64_t first = m * hop - size / 2, low = std::min(std::max<int64_t>(0, -first), size);
    return {first, low, std::max(std::min(size, count - first), low)};
}

}  // namespace

void cut_frames(Array<const float, 1> sample, Array<const float, 1> window, int64_t hop, Array<float, 2> frames) {
    for (int64_t m = 0; m < frames.size(); ++m) {
        const auto [first, low, high] = within(m, hop, window.size(), sample.size());
        const Array<float, 1> frame = frames[m];
        for (int64_t k = 0; k < low; ++k) frame[k] = 0;
        for (int64_t k = low; k < high; ++k) frame[k] = sample[first + k] * window[k];
        for (int64_t k = high; k < window.size(); ++k) frame[k] = 0;
    }
}

void add_frames(Array<const float, 2> frames, Array<const float, 1> window, int64_t hop, Array<float, 1> sample) {
    for (int64_t m = 0; m < frames.size(); ++m) {
        const auto [first, low, high] = within(m, hop, window.size(), sample.size());
        const Array<const float, 1> frame = frames[m];
        for (int64_t k = low; k < high; ++k) sample[first + k] += frame[k] * window[k];
    }
}

}  // namespace engine
