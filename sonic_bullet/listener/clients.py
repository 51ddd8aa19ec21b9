"""A client of our own, and who in a world could sound."""

from __future__ import annotations

from typing import Any

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.errors import SceneError
from sonic_bullet.listener.quiet import quiet_stdout
from sonic_bullet.listener.world import World


def direct_client() -> BulletClient:
    """A fresh PyBullet world without a window, connected without a word on stdout. Raises SceneError where PyBullet gives no more."""
    with quiet_stdout():
        client = BulletClient(pybullet.DIRECT)
    if client._client < 0:
        raise SceneError("PyBullet gives no further client", "disconnect those no longer needed")
    return client


def disconnect(client: BulletClient) -> None:
    """End a client made by `direct_client`; one that has ended already is left alone."""
    if pybullet.isConnected(client._client):
        pybullet.disconnect(client._client)


def links_with_shapes(world: World, body: int | None = None) -> tuple[tuple[int, int], ...]:
    """(body, link) of every link, or those of one body, that has a collision shape."""
    ask: Any = pybullet
    cid = world.client_id
    bodies = [ask.getBodyUniqueId(i, physicsClientId=cid) for i in range(ask.getNumBodies(physicsClientId=cid))] if body is None else [body]
    return tuple(
        (one, link)
        for one in bodies
        for link in range(-1, ask.getNumJoints(one, physicsClientId=cid))
        if ask.getCollisionShapeData(one, link, physicsClientId=cid)
    )
