"""PyBullet's centre-of-mass frames, read.

getBasePositionAndOrientation, getBaseVelocity            base (link -1)
getLinkStates(computeLinkVelocity=1, computeForwardKinematics=1)[0, 1, 6, 7]   links
"""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain

import numpy as np
import pybullet

from sonic_bullet.listener.frames import BEYOND, LINK_SPAN, Motion, Roster, encode
from sonic_bullet.records.coerce import shown
from sonic_bullet.records.errors import SceneError

SOFT = 3
"""What getDynamicsInfo tells of a soft body as its last entry but one (Bullet's BT_SOFT_BODY)."""


def check_connected(client_id: int) -> None:
    """Raise SceneError unless a physics server answers under this client id."""
    if not 0 <= client_id < 2**31 or not pybullet.getConnectionInfo(physicsClientId=client_id)["isConnected"]:
        raise SceneError(
            f"PyBullet client {shown(client_id)} is not connected",
            "connect first, e.g. BulletClient(pybullet.DIRECT), and attach before disconnecting",
        )


def body_ids(client_id: int) -> list[int]:
    """Ids of all bodies in the world, ascending."""
    return sorted(
        pybullet.getBodyUniqueId(i, physicsClientId=client_id)
        for i in range(pybullet.getNumBodies(physicsClientId=client_id))
    )


def is_soft(client_id: int, body: int) -> bool:
    """Whether an existing body is a soft one."""
    return bool(pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)[10] == SOFT)


def read_roster(client_id: int, leave_out: Collection[int] = ()) -> Roster:
    """List bodies, their links and which of them cannot move; without those to be left out and the soft ones."""
    bodies: list[tuple[int, int, bool]] = []
    codes: list[int] = []
    static: list[bool] = []
    soft: list[int] = []
    everyone = body_ids(client_id)
    for body in everyone:
        if body in leave_out:
            continue
        info = pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)
        if info[10] == SOFT:
            soft.append(body)
            continue
        joints = pybullet.getNumJoints(body, physicsClientId=client_id)
        fixed = info[0] == 0
        bodies.append((body, joints, fixed))
        codes.extend(int(encode(body, link)) for link in range(-1, joints))
        static.extend([fixed] + [False] * joints)
    return Roster(tuple(bodies), np.array(codes, np.int64), np.array(static, bool), len(everyone), tuple(soft))


def read_motion(client_id: int, roster: Roster) -> Motion:
    """Poses and twists now, numbers or not (`Motion.broken`).

    Raises pybullet.error where a body of the roster is gone or has other links.
    """
    still = (0.0, 0.0, 0.0)
    pose, twist, links = pybullet.getBasePositionAndOrientation, pybullet.getBaseVelocity, pybullet.getLinkStates
    count = pybullet.getNumJoints
    flat: list[tuple[float, ...]] = []
    for body, joints, fixed in roster.bodies:
        # another body has taken over the id: asking for a link that is not there would end the process
        if count(body, client_id) != joints:
            raise pybullet.error(f"body {body} has other links than before")
        flat.extend(pose(body, client_id))
        if fixed:
            flat.append(still)
            flat.append(still)
        else:
            flat.extend(twist(body, client_id))
        if joints:
            for state in links(
                body, range(joints), computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client_id
            ):
                flat.extend((state[0], state[1], state[6], state[7]))
    table = np.fromiter(chain.from_iterable(flat), float, 13 * len(roster.code)).reshape(-1, 13)
    wild = ~(np.abs(table) < BEYOND)
    broken = tuple(int(body) for body in np.unique(roster.code[wild.any(axis=1)] // LINK_SPAN)) if wild.any() else ()
    return Motion(
        roster,
        *(np.ascontiguousarray(part) for part in (table[:, 0:3], table[:, 3:7], table[:, 7:10], table[:, 10:13])),
        broken=broken,
    )
