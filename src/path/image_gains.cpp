#include "image_gains.hpp"

#include <cmath>
#include <initializer_list>

#include "sound_path.hpp"

namespace engine {

namespace {

// Compute ρ of a point from the line of an edge of a face.
double from_edge(const Image& face, int k, double side, const double point[3]) {
    double out = -side * face.half_m[k], height = -face.offset_m;
    for (int axis = 0; axis < 3; ++axis) {
        out += (point[axis] - face.centre_m[axis]) * face.axis[k][axis];
        height += point[axis] * face.normal[axis];
    }
    return std::sqrt(out * out + height * height);
}

// Compute F of a face for the line between two points, length apart, that meets its plane at ``crossing``.
double reflected_fraction(const Image& face, const double one[3], const double other[3], const double crossing[3],
                          double length) {
    constexpr double edge_wave_m = 0.343;  // of 1 kHz, the middle of what is heard
    double found = 1;
    for (int k = 0; k < 2; ++k) {
        double across = 0, along = 0;  // the crossing's place between the edges; the points' distance along them
        for (int axis = 0; axis < 3; ++axis) {
            across += (crossing[axis] - face.centre_m[axis]) * face.axis[k][axis];
            along += (other[axis] - one[axis]) * face.axis[1 - k][axis];
        }
        for (const double side : {-1.0, 1.0}) {
            const double inwards = face.half_m[k] - side * across;
            const double over = from_edge(face, k, side, one) + from_edge(face, k, side, other);
            const double longer = std::sqrt(over * over + along * along) - length;
            const double v = 2 * std::sqrt((longer > 0 ? longer : 0) / edge_wave_m);
            double t = 0.5 + 0.5 * (inwards > 0 ? v : -v);
            t = t < 0 ? 0 : (t > 1 ? 1 : t);
            found *= t * t * (3 - 2 * t);
        }
    }
    return found;
}

// Compute 1 - F of a face for the line between two points.
double transmitted_fraction(const Image& face, const double one[3], const double other[3]) {
    double near = -face.offset_m, far = -face.offset_m, square = 0, crossing[3];
    for (int axis = 0; axis < 3; ++axis) {
        near += face.normal[axis] * one[axis];
        far += face.normal[axis] * other[axis];
        square += (other[axis] - one[axis]) * (other[axis] - one[axis]);
    }
    if (near * far >= 0) return 1;
    const double part = near / (near - far);
    for (int axis = 0; axis < 3; ++axis) crossing[axis] = one[axis] + part * (other[axis] - one[axis]);
    return 1 - reflected_fraction(face, one, other, crossing, std::sqrt(square));
}

// Compute g of body b at position_m and image microphone c at image_m.
double image_gain(const Array<const Image, 1>& images, int64_t b, int64_t c, const double position_m[3],
                  const double image_m[3]) {
    const Image& face = images[c];
    double height = -face.offset_m, depth = face.offset_m, length = 0, foot[3], place[3];
    for (int axis = 0; axis < 3; ++axis) {
        height += face.normal[axis] * position_m[axis];
        depth -= face.normal[axis] * image_m[axis];
        length += (position_m[axis] - image_m[axis]) * (position_m[axis] - image_m[axis]);
    }
    length = std::sqrt(length);
    if (height <= 0 || depth < 0 || !(length < FARTHEST_M)) return 0;
    const double part = height / (height + depth);
    for (int axis = 0; axis < 3; ++axis) {
        foot[axis] = position_m[axis] + part * (image_m[axis] - position_m[axis]);
        place[axis] = image_m[axis] + 2 * depth * face.normal[axis];
    }
    const double cosine = (height + depth) / length;
    double found = reflected_fraction(face, position_m, image_m, foot, length);
    found *= (cosine - face.admittance) / (cosine + face.admittance);
    for (int64_t k = 0; k < images.size(); ++k) {
        const Image& other = images[k];
        if (found != 0 && k != c && other.active == 1 && other.own == face.own && other.owner != b)
            found *= transmitted_fraction(other, position_m, foot) * transmitted_fraction(other, foot, place);
    }
    return found;
}

// Test whether the body whose face mirrors lies where the face was found.
bool rests(const Image& face, const Array<const double, 2>& position_m, const Array<const double, 2>& quaternion_xyzw) {
    if (face.active != 1) return false;
    for (int axis = 0; axis < 3; ++axis)
        if (position_m(face.owner, axis) != face.position_m[axis]) return false;
    for (int axis = 0; axis < 4; ++axis)
        if (quaternion_xyzw(face.owner, axis) != face.quaternion_xyzw[axis]) return false;
    return true;
}

}  // namespace

void image_gains(const ImageScene& scene, Array<const double, 4> aim_m, Array<const double, 2> microphone_m,
                 Array<double, 3> gain) {
    if (scene.images.size() == 0) return;
    for (int end = 0; end < 2; ++end) {
        const Array<const double, 2>& position_m = scene.position_m[end];
        for (int64_t c = 0; c < microphone_m.shape[0]; ++c) {
            const Image& face = scene.images[c];
            const bool mirrors = face.own >= 0 && rests(face, position_m, scene.quaternion_xyzw[end]);
            for (int64_t b = 0; b < position_m.shape[0]; ++b) {
                gain(end, b, c) = face.own < 0 ? 1 : 0;
                if (mirrors && scene.has_image[b] == 1 && b != face.owner) {
                    const double* image_m = aim_m.size() > 0 ? &aim_m(end, b, c, 0) : &microphone_m(c, 0);
                    gain(end, b, c) = image_gain(scene.images, b, c, position_m[b].data, image_m);
                }
            }
        }
    }
}

}  // namespace engine
