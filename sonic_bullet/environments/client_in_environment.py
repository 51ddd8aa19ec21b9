"""Find the PyBullet client among an environment's attributes.

A BulletClient is searched for level by level, so that the one nearest to the environment is found; without one, an
attribute whose name contains "client" and that holds the id of a connected one, then the pybullet module. Attributes
are read as stored; no property is called.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any

from sonic_bullet.listener import is_bullet_client, is_connected
from sonic_bullet.records.errors import SceneError

DEPTH = 3
"""Levels of attributes that are searched: env.robot.sim.physics_client is the third."""
REMEDY = "give client=, a BulletClient, the pybullet module or a client id"


def client_in(env: Any) -> Any:
    """Return the BulletClient, client id or pybullet module of a gymnasium environment, None where it has none (yet).

    Raises
    ------
    SceneError
        Several are equally near.
    """
    level, seen = [env.unwrapped], {id(env.unwrapped)}
    numbers: dict[int, None] = {}
    module = None
    for _ in range(DEPTH):
        clients: dict[int, Any] = {}
        below = []
        for name, value in (part for thing in level for part in _parts(thing)):
            if is_bullet_client(value):
                clients[id(value)] = value
            elif isinstance(value, int):
                if "client" in name.lower() and is_connected(value):
                    numbers[int(value)] = None
            elif inspect.ismodule(value):
                module = value if value.__name__ == "pybullet" else module
            elif id(value) not in seen:
                seen.add(id(value))
                below.append(value)
        if clients:
            return _only(list(clients.values()), "PyBullet clients")
        level = below
    return _only(list(numbers), "client ids") if numbers else module


def _only(found: list[Any], what: str) -> Any:
    if len(found) > 1:
        raise SceneError(f"the environment has {len(found)} {what}", REMEDY)
    return found[0]


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    """Yield the parts of an object by name."""
    if isinstance(thing, Mapping):
        yield from ((str(name), value) for name, value in thing.items())
    elif isinstance(thing, list | tuple):
        yield from (("", value) for value in thing)
    elif not inspect.isclass(thing) and not inspect.isroutine(thing):
        yield from getattr(thing, "__dict__", {}).items()
