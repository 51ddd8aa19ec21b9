"""Clients of PyBullet, and the links in their worlds that can sound."""

from __future__ import annotations

import numbers
from typing import Any

import pybullet
from pybullet_utils.bullet_client import BulletClient

from sonic_bullet.records.coerce import as_whole, nearest, quote
from sonic_bullet.records.errors import MeshError, SceneError
from sonic_bullet.simulators.pybullet import body_facts as facts
from sonic_bullet.simulators.pybullet import hooks
from sonic_bullet.simulators.pybullet.colliding.given_bodies import begin
from sonic_bullet.simulators.pybullet.colliding.pieces import collision_pieces
from sonic_bullet.simulators.pybullet.poses import body_ids, check_connected, is_soft
from sonic_bullet.simulators.pybullet.pybullet_world import PyBulletWorld
from sonic_bullet.simulators.quiet import quiet_stdout


def direct_client() -> BulletClient:
    """Open a PyBullet world without a window, and without output on stdout.

    Raises
    ------
    SceneError
        PyBullet gives no further client.
    """
    with quiet_stdout():
        client = BulletClient(pybullet.DIRECT)
    begin(client._client)
    if client._client < 0:
        raise SceneError("PyBullet gives no further client", "disconnect those no longer needed")
    return client


def clear_file_cache() -> None:
    """Clear PyBullet's cache of meshes: it is keyed by file name, and the file may have changed."""
    client = direct_client()
    for kept in (0, 1):
        client.setPhysicsEngineParameter(enableFileCaching=kept)
    disconnect(client)


def watch_settings(client: BulletClient) -> None:
    """Record from now on the values set on engine and bodies, not all of which PyBullet reports later."""
    hooks.Hooks.of(client, client._client)


def disconnect(client: BulletClient) -> None:
    """End a client; one that has ended already is left alone.

    Its id is cleared, as BulletClient's finaliser would end the next client of that id.
    """
    client_id, client._client = client._client, -1
    begin(client_id)
    if client_id >= 0 and pybullet.isConnected(client_id):
        pybullet.disconnect(client_id)


def links_with_shapes(client_id: int, body: int | None = None) -> tuple[tuple[int, int], ...]:
    """List (body, link) of every link, or of one body's, with a collision shape; none of soft bodies."""
    ask: Any = pybullet
    cid = client_id
    bodies = (
        [ask.getBodyUniqueId(i, physicsClientId=cid) for i in range(ask.getNumBodies(physicsClientId=cid))]
        if body is None
        else [body]
    )
    return tuple(
        (one, link)
        for one in bodies
        if not is_soft(cid, one)
        for link in range(-1, ask.getNumJoints(one, physicsClientId=cid))
        if collision_pieces(cid, one, link)
    )


def is_static(client_id: int, body: int, link: int) -> bool:
    """Tell whether a link that exists can never move: the base of a body of mass 0."""
    return link < 0 and pybullet.getDynamicsInfo(body, -1, physicsClientId=client_id)[0] == 0


def links_called(world: facts.AskedLinks, body: Any, link: Any) -> tuple[int, tuple[int, ...]]:
    """Return the body's id and its links of that number or name; "all": every link that has a collision shape.

    Raises
    ------
    SceneError
        There is no such body or link, the body is soft, a mass or inertia is absurd, or a pose is not a number.
    MeshError
        "all" are none.
    """
    cid = world.client_id
    check_connected(cid)
    number = as_whole(body, "body", "pass the id that loading it returned", error=SceneError)
    facts.check_exists(cid, number, -1)
    facts.check_usable(cid, number)
    if isinstance(link, str) and link == "all":
        links = tuple(one for _, one in links_with_shapes(cid, number))
        if not links:
            raise MeshError(
                f"link is 'all', but no link of body {number} has a collision shape",
                "give it one, or add a link with mesh=",
            )
    elif isinstance(link, str):
        links = (_link_named(cid, number, link),)
    else:
        links = (as_whole(link, "link", 'give -1 (the base), a link\'s number or name, or "all"', error=SceneError),)
    for one in links:
        facts.check_exists(cid, number, one)
        facts.describe(cid, number, one, 0)
    return number, links


def _link_named(client_id: int, body: int, name: str) -> int:
    """Find the link, or base, that PyBullet calls so; SceneError lists the nearest names."""
    names = facts.link_names(client_id, body)
    if name not in names:
        raise SceneError(
            f"link is {quote(name)}, and body {body} has none of that name", nearest(name, names, ', or "all"')
        )
    return names.index(name) - 1


def client_id_of(client: Any) -> int:
    """Return the client id of a BulletClient, the pybullet module (its default client 0) or an id.

    Raises
    ------
    SceneError
        Nothing is connected.
    """
    if client is pybullet:
        client_id = 0
    elif isinstance(client, numbers.Integral) and not isinstance(client, bool):
        client_id = int(client)
    elif isinstance(getattr(client, "_client", None), int):
        client_id = client._client
    else:
        raise SceneError(f"client is {quote(client)}", "pass a BulletClient, the pybullet module or a client id")
    check_connected(client_id)
    return client_id


def is_connected(client_id: int) -> bool:
    """Tell whether a physics server answers under this id."""
    if isinstance(client_id, bool) or not 0 <= client_id < 2**31:
        return False
    return bool(pybullet.getConnectionInfo(physicsClientId=client_id)["isConnected"])


def is_bullet_client(thing: Any) -> bool:
    """Tell whether an object is a connected BulletClient, or a wrapper like it, whose steps can be hooked."""
    client_id = getattr(thing, "__dict__", {}).get("_client")
    return isinstance(client_id, int) and hasattr(thing, "stepSimulation") and is_connected(client_id)


def bodies_called(client_id: int, name: str) -> tuple[int, ...]:
    """Return the ids of all bodies of that name, their own or their base's; SceneError lists the nearest names."""
    found, names = [], set()
    for body in body_ids(client_id):
        own = {text.decode(errors="replace") for text in pybullet.getBodyInfo(body, physicsClientId=client_id)}
        names |= own - {""}
        if name in own:
            found.append(body)
    if not found:
        raise SceneError(f"no body is called {quote(name)}", nearest(name, sorted(names), ", or a body's id"))
    return tuple(found)


def open_world(client: Any) -> PyBulletWorld:
    """Open a world of a BulletClient, the pybullet module (its client 0) or a client id.

    Raises
    ------
    SceneError
        Nothing is connected there.
    """
    return PyBulletWorld(client, client_id_of(client))
