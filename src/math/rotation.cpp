#include "rotation.hpp"

#include <cmath>

namespace engine {

void rotate(const double q[4], const double vector[3], double rotated[3]) {
    const double x = vector[0], y = vector[1], z = vector[2];
    const double s = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double a = s * (q[1] * z - q[2] * y), b = s * (q[2] * x - q[0] * z), c = s * (q[0] * y - q[1] * x);
    rotated[0] = x + q[3] * a + q[1] * c - q[2] * b;
    rotated[1] = y + q[3] * b + q[2] * a - q[0] * c;
    rotated[2] = z + q[3] * c + q[0] * b - q[1] * a;
}

void rotate_back(const double q[4], const double vector[3], double rotated[3]) {
    const double back[4] = {-q[0], -q[1], -q[2], q[3]};
    rotate(back, vector, rotated);
}

void fill_rotation(const double q[4], double (&matrix)[3][3]) {
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]), w = q[3] / norm;
    for (int x = 0; x < 3; ++x) {
        const int y = (x + 1) % 3, z = (x + 2) % 3;
        const double u = q[x] / norm, v = q[y] / norm, t = q[z] / norm;
        matrix[x][x] = 1.0 - 2.0 * (v * v + t * t);
        matrix[x][y] = 2.0 * (u * v - t * w);
        matrix[y][x] = 2.0 * (u * v + t * w);
    }
}

}  // namespace engine
