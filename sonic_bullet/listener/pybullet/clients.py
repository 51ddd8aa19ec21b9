"""A client of our own, and who in a world could sound."""

from __future__ import annotations

from typing import Any

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.listener.pybullet.pieces import collision_pieces
from sonic_bullet.listener.pybullet.world import World
from sonic_bullet.listener.quiet import quiet_stdout
from sonic_bullet.records.errors import SceneError


def direct_client() -> BulletClient:
    """A fresh PyBullet world without a window, connected without a word on stdout. Raises SceneError where PyBullet gives no more."""
    with quiet_stdout():
        client = BulletClient(pybullet.DIRECT)
    if client._client < 0:
        raise SceneError("PyBullet gives no further client", "disconnect those no longer needed")
    return client


def disconnect(client: BulletClient) -> None:
    """End a client; one that has ended already is left alone. Its id is cleared, for BulletClient's finaliser would end whoever has it next."""
    client_id, client._client = client._client, -1
    if client_id >= 0 and pybullet.isConnected(client_id):
        pybullet.disconnect(client_id)


def links_with_shapes(world: World, body: int | None = None) -> tuple[tuple[int, int], ...]:
    """(body, link) of every link, or those of one body, that has a collision shape."""
    ask: Any = pybullet
    cid = world.client_id
    bodies = [ask.getBodyUniqueId(i, physicsClientId=cid) for i in range(ask.getNumBodies(physicsClientId=cid))] if body is None else [body]
    return tuple((one, link) for one in bodies for link in range(-1, ask.getNumJoints(one, physicsClientId=cid)) if collision_pieces(cid, one, link))
