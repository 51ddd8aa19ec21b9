// Poses and twists of links from MuJoCo's tables, in centre-of-mass frames.
#pragma once

#include "listener_tables.hpp"

namespace engine {

// MuJoCo's tables, by body. Quaternions w x y z; velocities as spin, then velocity at centre[root] (mjData.cvel), the
// centre of mass of the whole tree (MuJoCo documentation, mjData.cvel).
struct MujocoBodies {
    Array<const double, 2> centre_m;       // xipos
    Array<const double, 2> orientation;    // xquat
    Array<const double, 2> inertia_frame;  // body_iquat
    Array<const double, 2> velocity;       // cvel
    Array<const double, 2> tree_centre_m;  // subtree_com
    Array<const int32_t, 1> root;          // body_rootid
};

// Fill states (n,) of the bodies of links (n,); those of body 0, the world, stay.
void read_mujoco_motion(Array<const int64_t, 1> body, const MujocoBodies& bodies, Array<LinkState, 1> state);

}  // namespace engine
