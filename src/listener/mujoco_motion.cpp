#include "mujoco_motion.hpp"

namespace engine {

void read_mujoco_motion(Array<const int64_t, 1> body, const MujocoBodies& bodies, Array<LinkState, 1> state) {
    for (int64_t i = 0; i < body.size(); ++i) {
        const int64_t n = body[i], root = n == 0 ? 0 : bodies.root[n];
        if (n == 0) continue;
        LinkState& to = state[i];
        const double *p = bodies.orientation[n].data, *q = bodies.inertia_frame[n].data, *v = bodies.velocity[n].data;
        const double *place = bodies.centre_m[n].data, *centre = bodies.tree_centre_m[root].data;
        for (int x = 0; x < 3; ++x) {
            const int y = (x + 1) % 3, z = (x + 2) % 3;
            const double arm_y = place[y] - centre[y], arm_z = place[z] - centre[z];
            to.position_m[x] = place[x], to.spin_rad_s[x] = v[x];
            to.velocity_m_s[x] = v[3 + x] + v[y] * arm_z - v[z] * arm_y;
            to.quaternion_xyzw[x] = p[0] * q[1 + x] + q[0] * p[1 + x] + p[1 + y] * q[1 + z] - p[1 + z] * q[1 + y];
        }
        to.quaternion_xyzw[3] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    }
}

}  // namespace engine
