#include "../vector8_elementary.hpp"
#include "panels.hpp"

namespace engine {

namespace VECTOR_LEVEL {
namespace {

void integrate(const Panel& panel, const Targets& targets, double (*out)[8]) {
    Double8 p[3][3], r[3];  // from the corners to the target
    for (int e = 0; e < 3; ++e) {
        for (int axis = 0; axis < 3; ++axis)
            p[e][axis] = load(targets.place_m[axis]) - broadcast(panel.corner_m[e][axis]);
        r[e] = root(p[e][0] * p[e][0] + p[e][1] * p[e][1] + p[e][2] * p[e][2]);
    }
    const Double8 zero = broadcast(0.0);
    Double8 potential = zero, whole = r[0] * r[1] * r[2], triple = zero, gradient[3] = {zero, zero, zero},
            loop[3] = {zero, zero, zero};
    for (int e = 0; e < 3; ++e) {
        const int next = e == 2 ? 0 : e + 1, last = e == 0 ? 2 : e - 1;
        const Double8(&a)[3] = p[e];
        const Double8(&b)[3] = p[next];
        const Double8 across[3] = {broadcast(panel.across[e][0]), broadcast(panel.across[e][1]),
                                   broadcast(panel.across[e][2])};
        const Double8 edge = broadcast(panel.edge_m[e]), sum = r[e] + r[next], product = r[e] * r[next];
        const Double8 ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        const Double8 cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const Double8 near = log((sum + edge) / (sum - edge));
        potential = potential - (across[0] * a[0] + across[1] * a[1] + across[2] * a[2]) * near;
        const Double8 turn = sum / (product * (product + ab));
        for (int axis = 0; axis < 3; ++axis) {
            gradient[axis] = gradient[axis] - across[axis] * near;
            loop[axis] = loop[axis] + cross[axis] * turn;
        }
        whole = whole + ab * r[last];
        if (e == 1) triple = p[0][0] * cross[0] + p[0][1] * cross[1] + p[0][2] * cross[2];
    }
    const Double8 n[3] = {broadcast(panel.normal[0]), broadcast(panel.normal[1]), broadcast(panel.normal[2])};
    const Double8 m[3] = {load(targets.normal[0]), load(targets.normal[1]), load(targets.normal[2])};
    const Double8 height = n[0] * p[0][0] + n[1] * p[0][1] + n[2] * p[0][2];
    const Double8 angle = broadcast(2.0) * atan2(triple, whole);
    store(out[0], potential - height * angle);
    store(out[1], angle);
    store(out[2], m[0] * gradient[0] + m[1] * gradient[1] + m[2] * gradient[2] -
                      (n[0] * m[0] + n[1] * m[1] + n[2] * m[2]) * angle);
    store(out[3], zero - (m[0] * loop[0] + m[1] * loop[1] + m[2] * loop[2]));
}

}  // namespace
}  // namespace VECTOR_LEVEL

VECTOR_TABLE(Panels, panels) = {VECTOR_LEVEL::integrate};

}  // namespace engine
