#include "mode_shapes.hpp"

#include <cmath>
#include <vector>

namespace engine {

constexpr int TINIEST = -126;       // exponent of the smallest normal float32
constexpr float WHOLE = 0x1.8p23f;  // a sum with it is a whole number, the nearest, of ties the even one

void round_shapes(Array<float, 2> shape, int bits) {
    const int64_t rows = shape.shape[0], modes = shape.shape[1];
    std::vector<float> most(modes, 0.0f), up(modes), down(modes);
    for (int64_t i = 0; i < rows; ++i) {
        const float* row = shape[i].data;
        for (int64_t m = 0; m < modes; ++m) most[m] = std::fabs(row[m]) > most[m] ? std::fabs(row[m]) : most[m];
    }
    for (int64_t m = 0; m < modes; ++m) {
        int exponent = 0;
        std::frexp(static_cast<double>(most[m]), &exponent);
        exponent = exponent - bits > TINIEST ? exponent - bits : TINIEST;
        up[m] = std::ldexp(1.0f, -exponent), down[m] = std::ldexp(1.0f, exponent);
    }
    for (int64_t i = 0; i < rows; ++i) {
        float* row = shape[i].data;
        for (int64_t m = 0; m < modes; ++m) row[m] = ((row[m] * up[m] + WHOLE) - WHOLE) * down[m];
    }
}

void find_largest_motions(Array<const float, 3> shape, Doubles largest) {
    const int64_t modes = largest.size();
    set_zero(largest.data, modes);
    for (int64_t v = 0; v < shape.size(); ++v) {
        const float *x = shape.data + 3 * v * modes, *y = x + modes, *z = y + modes;
        for (int64_t m = 0; m < modes; ++m) {
            const double a = x[m], b = y[m], c = z[m], square = a * a + b * b + c * c;
            largest[m] = square > largest[m] ? square : largest[m];
        }
    }
    for (int64_t m = 0; m < modes; ++m) largest[m] = std::sqrt(largest[m]);
}

}  // namespace engine
