#include "kinematics.hpp"

#include <algorithm>
#include <cmath>

#include "../math/elementary.hpp"

namespace engine {

void pose_after(const LinkStart& link, double elapsed_s, double position_m[3], double quaternion_xyzw[4]) {
    const double *q = link.quaternion_xyzw, *w = link.spin_rad_s;
    for (int x = 0; x < 3; ++x) position_m[x] = link.position_m[x] + elapsed_s * link.velocity_m_s[x];
    const double angle = elapsed_s * std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    if (angle == 0) {
        std::copy(q, q + 4, quaternion_xyzw);
        return;
    }
    const double s = elapsed_s * sin(angle / 2) / angle, c = cos(angle / 2);
    const double a = s * w[0], b = s * w[1], d = s * w[2];
    quaternion_xyzw[0] = c * q[0] + a * q[3] + b * q[2] - d * q[1];
    quaternion_xyzw[1] = c * q[1] + b * q[3] + d * q[0] - a * q[2];
    quaternion_xyzw[2] = c * q[2] + d * q[3] + a * q[1] - b * q[0];
    quaternion_xyzw[3] = c * q[3] - a * q[0] - b * q[1] - d * q[2];
}

double relative_motion(const LoadedContact& contact, const LinkStart& a, const LinkStart& b, double slip_m_s[3]) {
    const double *va = a.velocity_m_s, *vb = b.velocity_m_s, *wa = a.spin_rad_s, *wb = b.spin_rad_s;
    const double* n = contact.normal;
    double r[3], s[3];
    for (int x = 0; x < 3; ++x) {
        r[x] = contact.point_a_m[x] - a.position_m[x];
        s[x] = contact.point_b_m[x] - b.position_m[x];
    }
    const double ux = va[0] + wa[1] * r[2] - wa[2] * r[1] - vb[0] - wb[1] * s[2] + wb[2] * s[1];
    const double uy = va[1] + wa[2] * r[0] - wa[0] * r[2] - vb[1] - wb[2] * s[0] + wb[0] * s[2];
    const double uz = va[2] + wa[0] * r[1] - wa[1] * r[0] - vb[2] - wb[0] * s[1] + wb[1] * s[0];
    const double along = ux * n[0] + uy * n[1] + uz * n[2];
    slip_m_s[0] = ux - along * n[0], slip_m_s[1] = uy - along * n[1], slip_m_s[2] = uz - along * n[2];
    return -along;
}

void rotation_between(const double first[4], const double second[4], double vector_rad[3]) {
    const double *p = first, *q = second, w = first[3], v = second[3];
    const double scalar = w * v + (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]);
    vector_rad[0] = w * q[0] - v * p[0] - (q[1] * p[2] - q[2] * p[1]);
    vector_rad[1] = w * q[1] - v * p[1] - (q[2] * p[0] - q[0] * p[2]);
    vector_rad[2] = w * q[2] - v * p[2] - (q[0] * p[1] - q[1] * p[0]);
    const double length =
        std::sqrt(vector_rad[0] * vector_rad[0] + vector_rad[1] * vector_rad[1] + vector_rad[2] * vector_rad[2]);
    const double scale = 2 * atan2(length, std::fabs(scalar)) / std::max(length, 1e-300);
    for (int x = 0; x < 3; ++x) vector_rad[x] *= scalar < 0 ? -scale : scale;
}

}  // namespace engine
