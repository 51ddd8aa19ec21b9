"""Bounces that a world loses, and bounces that never end.

Bullet reports neither contactProcessingThreshold nor restitutionVelocityThreshold: `keep_restitution` leaves a mark
(user data) beside the first, and `hooks.seen_settings` observes what a scene sets.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pybullet

from sonic_bullet.simulators.properties import SetValues
from sonic_bullet.simulators.pybullet.body_facts import describe_link
from sonic_bullet.simulators.pybullet.clients import client_id_of
from sonic_bullet.simulators.pybullet.findings import Finding, all_links, name_links

THRESHOLD_DATA = "sonic_bullet.contactProcessingThreshold"


def keep_restitution(client: Any) -> int:
    """Set contactProcessingThreshold = 0 on every link of every body loaded so far, so that small steps bounce.

    With the default, restitution 0.5 gives rebounds of 0.36–0.57 at 1/240 s and 0.000 at 1/4000 s; with 0, 0.51–0.59 at
    both (bullet3 issues 3094, 1530, 4341). Call it after loading.

    Returns
    -------
    int
        Number of links.

    Raises
    ------
    SceneError
        The client is not connected.
    """
    client_id = client_id_of(client)
    links = all_links(client_id)
    for body, link in links:
        pybullet.changeDynamics(body, link, contactProcessingThreshold=0, physicsClientId=client_id)
        pybullet.addUserData(body, THRESHOLD_DATA, "0", link, physicsClientId=client_id)
    return len(links)


def lost_restitution(client_id: int, known: SetValues) -> list[Finding]:
    """Find bounces that are asked for and that Bullet's default contact threshold suppresses."""
    links = all_links(client_id)
    bouncy = {entry: pybullet.getDynamicsInfo(*entry, physicsClientId=client_id)[5] for entry in links}
    movable = [
        (body, link) for body, link in links if pybullet.getDynamicsInfo(body, link, physicsClientId=client_id)[0] > 0
    ]
    springy = {body for (body, _), value in bouncy.items() if value > 0}
    lost = [
        e
        for e in movable
        if bouncy[e] > 0
        and springy - {e[0]}
        and pybullet.getUserDataId(e[0], THRESHOLD_DATA, e[1], physicsClientId=client_id) < 0
        and known.of(*e).get("contactProcessingThreshold") != 0
    ]
    if not lost:
        return []
    dt = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)["fixedTimeStep"]
    names = name_links(client_id, lost)
    return [
        Finding(
            "restitution-lost",
            "warning",
            f"{names}: restitution {bouncy[lost[0]]:g} is asked for, but Bullet's default contact threshold "
            f"loses some or all of it at a step of {dt:.4g} s",
            "call sonic_bullet.keep_restitution(client) after loading",
        )
    ]


def endless_bounces(client_id: int, known: SetValues) -> list[Finding]:
    """Find bodies that never come to rest, as the restitution threshold is too low.

    With restitution e, steps of dt bring nothing below g·dt·e/(1-e) to rest.
    """
    parameter = "restitutionVelocityThreshold"
    threshold = known.engine.get(parameter)
    if threshold is None:
        return []
    settings = pybullet.getPhysicsEngineParameters(physicsClientId=client_id)
    gravity = float(np.linalg.norm([settings[f"gravityAcceleration{axis}"] for axis in "XYZ"]))
    links = [(*entry, pybullet.getDynamicsInfo(*entry, physicsClientId=client_id)) for entry in all_links(client_id)]
    worst, speed = None, threshold
    for body, link, info in links:
        others = [other[5] for who, _, other in links if who != body]
        e = min(info[5] * max(others, default=0.0), 0.999)
        if info[0] > 0 and (again := gravity * settings["fixedTimeStep"] * e / (1 - e)) > max(speed, 1e-9):
            worst, speed = (body, link, e), again
    if worst is None:
        return []
    body, link, e = worst
    return [
        Finding(
            "restitution-threshold",
            "warning",
            f"restitutionVelocityThreshold is {threshold:g} m/s: {describe_link(client_id, body, link)}, of "
            f"restitution {e:.2g} against what it touches, never comes to rest at a step of "
            f"{settings['fixedTimeStep']:.4g} s but bounces on at about {speed:.2g} m/s",
            f"set restitutionVelocityThreshold above {speed:.2g} m/s (Bullet's default is 0.2), or a shorter step",
        )
    ]
