"""Bullet's semi-implicit step, taken back where nothing was read before it.

x = x' - v' dt,   v = v' - g dt - ΣJ/m,   ω = ω' - I⁻¹ Σ (p - x) × J        (single bodies; of links only the pose)
"""

from __future__ import annotations

import numpy as np
import pybullet

from sonic_bullet.listener.frames import Motion, advanced, decode
from sonic_bullet.listener.polling import Touches
from sonic_bullet.records import Array


def undone(now: Motion, which: Array, touches: Touches, dt_s: float, client_id: int) -> Motion:
    """The motion one step earlier, right in the rows `which` (n,)."""
    settings = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)
    gravity = np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
    single = {body for body, joints, _ in now.roster.bodies if joints == 0}
    back = advanced(now, -dt_s)
    velocity, spin = back.velocity_m_s.copy(), back.spin_rad_s.copy()
    for row in np.flatnonzero(which & ~now.roster.static):
        code = now.roster.code[row]
        body, link = decode(code)
        info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
        if body not in single or not 0 < info[0] < np.inf:
            continue
        sign = (touches.code_a == code).astype(float) - (touches.code_b == code)
        own = sign != 0
        rows = touches.row[own]
        impulse = sign[own, None] * rows["impulse_n_s"]
        point = np.where(rows["code_a"][:, None] == code, rows["point_a_m"], rows["point_b_m"])
        turn = np.array(pybullet.getMatrixFromQuaternion(back.quaternion_xyzw[row])).reshape(3, 3)
        angular = np.cross(point - back.position_m[row], impulse).sum(axis=0)
        inverse = np.array([1 / x if x > 0 else 0.0 for x in info[2]])
        velocity[row] -= impulse.sum(axis=0) / info[0] + gravity * dt_s
        spin[row] -= turn @ (inverse * (turn.T @ angular))
    return Motion.of(now.roster, back.position_m, back.quaternion_xyzw, velocity, spin)
