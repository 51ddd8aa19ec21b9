"""How links of jointed PyBullet bodies move, as rows of LINK_MOTION: poses, masses, axes -> rigid_modes -> rows.

Read after the step, of bodies that a sensor is on, once something touches them: joints turn by less than a part in a
hundred in a step. The joint's axis is given in the child's principal frame; spherical and planar joints move along no
one axis and are taken as held.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.records import Array, Body
from sonic_bullet.records.touching.link_motions import LINK_MOTION
from sonic_bullet.simulators.rigid_modes import JointedBody, rigid_modes
from sonic_bullet.simulators.world import JointSprings

NO_SPRINGS: Mapping[int, Any] = MappingProxyType({})


def jointed_body(client_id: int, body: int, springs: JointSprings = NO_SPRINGS) -> JointedBody:
    """Read links and joints of a multibody; springs: of its joints."""
    at = {"physicsClientId": client_id}
    count = pybullet.getNumJoints(body, **at)
    base = pybullet.getBasePositionAndOrientation(body, **at)
    state = [pybullet.getLinkState(body, j, computeForwardKinematics=True, **at) for j in range(count)]
    turned = [base[1], *(one[1] for one in state)]
    rotation = np.reshape([pybullet.getMatrixFromQuaternion(one) for one in turned], (-1, 3, 3))
    facts = [pybullet.getDynamicsInfo(body, j, **at) for j in range(-1, count)]
    joint = [pybullet.getJointInfo(body, j, **at) for j in range(count)]
    under = np.zeros((count, count + 1), bool)
    for j in reversed(range(count)):  # a child's number is above its parent's
        under[j, j + 1] = True
        if joint[j][16] >= 0:
            under[joint[j][16]] |= under[j]
    moving = [j for j in range(count) if joint[j][2] in (pybullet.JOINT_REVOLUTE, pybullet.JOINT_PRISMATIC)]
    axis = [rotation[j + 1] @ np.array(joint[j][13]) for j in moving]
    held = [springs.get(j, (0.0, 0.0)) for j in moving]
    return JointedBody(
        np.array([base[0], *(one[0] for one in state)]),
        rotation,
        np.array([one[0] for one in facts]),
        np.array([one[2] for one in facts]),
        under[moving],
        np.reshape(axis, (-1, 3)),
        np.reshape([state[j][4] for j in moving], (-1, 3)),
        np.array([joint[j][2] == pybullet.JOINT_REVOLUTE for j in moving], bool),
        facts[0][0] > 0,
        *np.reshape(held, (-1, 2)).T,
    )


def link_motions(client_id: int, body: int, recorded: Mapping[int, int], springs: JointSprings = NO_SPRINGS) -> Array:
    """Return rows (r,) of LINK_MOTION of a body's recorded links: indices in the log by link, ascending in both."""
    shape, rate, decay = rigid_modes(jointed_body(client_id, body, springs))
    links = [link for link in recorded if link + 1 < shape.shape[1]]
    rows = np.zeros((len(links), len(rate)), LINK_MOTION)
    rows["body"] = np.array([recorded[link] for link in links], np.int32).reshape(-1, 1)
    rows["mode"], rows["rate_rad_s"], rows["decay_per_s"] = np.arange(len(rate)), rate, decay
    rows["shape"] = shape[:, [link + 1 for link in links]].transpose(1, 0, 2)
    return rows.reshape(-1)


def touched_motions(
    client_id: int,
    felt: Collection[int],
    living: Mapping[int, Body],
    touched: Array,
    springs: Mapping[int, JointSprings] = NO_SPRINGS,
) -> Array | None:
    """Return rows of LINK_MOTION of jointed bodies of the ids ``felt`` that something touches; None where nothing does.

    living: records by index; touched: indices of bodies with contacts; springs: by body.
    """
    hit = {living[i].body_id for i in np.unique(touched).tolist() if i in living and living[i].body_id in felt}
    parts = []
    for body in sorted(hit):
        if pybullet.getNumJoints(body, physicsClientId=client_id):
            links = {one.link: index for index, one in living.items() if one.body_id == body}
            parts.append(link_motions(client_id, body, links, springs.get(body, NO_SPRINGS)))
    return np.concatenate(parts) if parts else None
