"""PyBullet's centre-of-mass frames, and Bullet's semi-implicit step undone where no pose was read before it.

getBasePositionAndOrientation, getBaseVelocity            base (link -1)
getLinkStates(computeLinkVelocity=1, computeForwardKinematics=1)[0, 1, 6, 7]   links
x = x' - v' dt,   v = v' - g dt - ΣJ/m,   ω = ω' - I⁻¹ Σ (p - x) × J        (single bodies; of links only the pose)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
import pybullet

from sonic_bullet import _engine
from sonic_bullet.records import Array
from sonic_bullet.records.coerce import quote
from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.frames import (
    INVALID_BEYOND,
    LINK_SPAN,
    MOTION_NUMBERS,
    Motion,
    Roster,
    advance_motion,
    decode,
    encode,
)
from sonic_bullet.simulators.polling import Touches

SOFT = 3
"""Last entry but one of getDynamicsInfo for a soft body (Bullet's BT_SOFT_BODY)."""


def check_connected(client_id: int) -> None:
    """Raise SceneError unless a physics server answers under this client id."""
    if not 0 <= client_id < 2**31 or not pybullet.getConnectionInfo(physicsClientId=client_id)["isConnected"]:
        raise SceneError(
            f"PyBullet client {quote(client_id)} is not connected",
            "connect first, e.g. BulletClient(pybullet.DIRECT), and attach before disconnecting",
        )


def body_ids(client_id: int) -> list[int]:
    """Return the ids of all bodies in the world, ascending."""
    return sorted(
        pybullet.getBodyUniqueId(i, physicsClientId=client_id)
        for i in range(pybullet.getNumBodies(physicsClientId=client_id))
    )


def body_exists(client_id: int, body: int) -> bool:
    """Tell whether the world holds a body of this id."""
    try:
        pybullet.getBodyInfo(body, physicsClientId=client_id)
    except (pybullet.error, OverflowError):  # the latter of more than 31 bits
        return False
    return True


def is_soft(client_id: int, body: int) -> bool:
    """Tell whether an existing body is soft."""
    return bool(pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)[10] == SOFT)


def read_roster(client_id: int, leave_out: Collection[int] = ()) -> Roster:
    """List bodies, links and which of them are static, without soft bodies and those of `leave_out`."""
    everyone = body_ids(client_id)
    return roster_of(client_id, [body for body in everyone if body not in leave_out], len(everyone))


def roster_of(client_id: int, among: Iterable[int], count: int = 0) -> Roster:
    """List these existing bodies, ascending ids, without soft ones. count: of all bodies in the world."""
    bodies: list[tuple[int, int, bool]] = []
    codes: list[int] = []
    static: list[bool] = []
    soft: list[int] = []
    for body in among:
        info = pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)
        if info[10] == SOFT:
            soft.append(body)
            continue
        joints = pybullet.getNumJoints(body, physicsClientId=client_id)
        fixed = info[0] == 0
        bodies.append((body, joints, fixed))
        codes.extend(int(encode(body, link)) for link in range(-1, joints))
        static.extend([fixed] + [False] * joints)
    return Roster(tuple(bodies), np.array(codes, np.int64), np.array(static, bool), count, tuple(soft))


class StateReader:
    """Asks for poses and twists of a roster's links, of static bases for the pose alone.

    hooked: whether `forget` is called where somebody may have moved a static base; then they are asked for in turn.
    """

    def __init__(self, client_id: int, roster: Roster, *, hooked: bool = False) -> None:
        self.roster = roster
        bodies = tuple(  # with link velocities and forward kinematics
            ((body, client_id), joints, int(fixed), (body, list(range(joints)), 1, 1, client_id))
            for body, joints, fixed in roster.bodies
        )
        self.questions = _engine.StateReader(
            pybullet.getNumJoints,
            pybullet.getBasePositionAndOrientation,
            pybullet.getBaseVelocity,
            pybullet.getLinkStates,
            bodies,
            len(roster.code),
            hooked,
        )
        self.forget = self.questions.forget

    def read(self) -> Motion:
        """Read them, numbers unchecked (`Motion.broken`).

        Raises
        ------
        pybullet.error
            A body of the roster is gone or has other links.
        """
        state, found = self.questions.read()
        if found > 0:
            return Motion(self.roster, state)
        if found < 0:
            raise pybullet.error(f"body {self.roster.bodies[-1 - found][0]} has other links than before")
        number = state.view(np.float64).reshape(-1, MOTION_NUMBERS)
        wild = ~(np.abs(number) < INVALID_BEYOND).all(axis=1)
        broken = tuple(int(body) for body in np.unique(self.roster.code[wild] // LINK_SPAN))
        return Motion(self.roster, state, broken=broken)


def read_motion(client_id: int, roster: Roster) -> Motion:
    """Read poses and twists once: see `StateReader`."""
    return StateReader(client_id, roster).read()


def undone(now: Motion, which: Array, touches: Touches, dt_s: float, client_id: int) -> Motion:
    """Return the motion one step earlier, right in the rows `which` (n,)."""
    settings = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)
    gravity = np.array([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"])
    single = {body for body, joints, _ in now.roster.bodies if joints == 0}
    back = advance_motion(now, -dt_s)
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
