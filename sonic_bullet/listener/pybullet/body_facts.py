"""Facts of one link by value: name, mass, inertia. Bullet takes NaN, negative and 1e300 masses silently; we do not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pybullet

from sonic_bullet.listener.frames import NO_NUMBER, link_words
from sonic_bullet.listener.pybullet.pieces import collision_pieces
from sonic_bullet.listener.pybullet.poses import body_ids, is_soft, read_motion, read_roster
from sonic_bullet.records import Body
from sonic_bullet.records.coerce import LISTED, shown
from sonic_bullet.records.errors import SceneError

HEAVIEST_KG = 1e12


def check_exists(client_id: int, body: int, link: int) -> None:
    """Raise SceneError unless the world holds this link.

    (getDynamicsInfo would end the process on a link that is not there.)
    """
    known = body_ids(client_id)
    if body not in known:
        few = ", ".join(map(str, known[:LISTED])) + (f" and {len(known) - LISTED} more" if len(known) > LISTED else "")
        raise SceneError(
            f"no body {shown(body)}; known: {few or 'none'}", "load it first, and use the id that loading returned"
        )
    joints = pybullet.getNumJoints(body, physicsClientId=client_id)
    if not -1 <= link < joints:
        raise SceneError(
            f"body {body} has no link {shown(link)}",
            "use -1, the base, its only link" if joints == 0 else f"use -1 (base) … {joints - 1}",
        )


def check_usable(client_id: int, body: int) -> None:
    """Raise SceneError where an existing body is soft, or its pose or speed is not a number."""
    if is_soft(client_id, body):
        raise SceneError(
            f"body {body} ({link_name(client_id, body, -1)}) is a soft body, which cannot sound",
            "load it as a rigid body with createMultiBody or loadURDF",
        )
    if read_motion(client_id, read_roster(client_id, [other for other in body_ids(client_id) if other != body])).broken:
        raise SceneError(
            f"body {body} has {NO_NUMBER}", "check its mass, inertia and what touches it; remove it or reset the scene"
        )


def link_name(client_id: int, body: int, link: int) -> str:
    """A name for people: the body's, and the link's where it is not the base."""
    base, whole = (text.decode(errors="replace") for text in pybullet.getBodyInfo(body, physicsClientId=client_id))
    name = whole or base or f"body {body}"
    return (
        name
        if link < 0
        else f"{name}/{pybullet.getJointInfo(body, link, physicsClientId=client_id)[12].decode(errors='replace')}"
    )


def link_names(client_id: int, body: int) -> list[str]:
    """The names that PyBullet has for a body's links, the base's first."""
    base = pybullet.getBodyInfo(body, physicsClientId=client_id)[0].decode(errors="replace")
    joints = range(pybullet.getNumJoints(body, physicsClientId=client_id))
    return [
        base,
        *(
            pybullet.getJointInfo(body, joint, physicsClientId=client_id)[12].decode(errors="replace")
            for joint in joints
        ),
    ]


def checked_mass_kg(info: tuple[Any, ...], body: int, link: int) -> float:
    """Mass of getDynamicsInfo's answer; SceneError where it is negative, absurd or not a number, or the inertia is
    not one.
    """
    mass, inertia = info[0], info[2]
    if not (math.isfinite(mass) and 0 <= mass < HEAVIEST_KG):
        raise SceneError(
            f"body {body}{link_words(link)} has mass {mass} kg",
            "give it a finite mass of zero or more with changeDynamics or in its URDF",
        )
    if not all(math.isfinite(x) and x >= 0 for x in inertia):
        raise SceneError(
            f"body {body}{link_words(link)} has inertia {inertia} kg m²",
            "give it a finite inertia with changeDynamics or in its URDF",
        )
    return float(mass)


def describe(client_id: int, body: int, link: int, epoch: int) -> Body:
    """The silent record of a link that exists. getDynamicsInfo's inertia is diagonal in the body frame: both are the
    inertial frame (measured: R·diag·Rᵀ·ω stays constant in free spin, whatever localInertialOrn). Raises SceneError on
    absurd mass or inertia."""
    info = pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)
    mass = checked_mass_kg(info, body, link)
    pieces = collision_pieces(client_id, body, link)
    curvature = (
        1 / pieces[0].size[0]
        if len(pieces) == 1 and pieces[0].kind == pybullet.GEOM_SPHERE and pieces[0].size[0] > 0
        else math.nan
    )
    return Body(body, link, epoch, link_name(client_id, body, link), mass, np.diag(info[2]), curvature_per_m=curvature)
