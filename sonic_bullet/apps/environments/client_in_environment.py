"""Find the PyBullet client, or MuJoCo's model and data, among an environment's attributes.

A BulletClient, or an object that holds an MjModel and an MjData, is searched for level by level, so that the one
nearest to the environment is found; without one, an attribute whose name contains "client" and that holds the id of a
connected one, then the pybullet module. Attributes are read as stored; no property is called.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from typing import Any

from sonic_bullet.records.errors import SceneError
from sonic_bullet.simulators.opening import bullet_client, connected_number, is_mujoco, mujoco_pair

GIVE_CLIENT = "give client=, a BulletClient, the pybullet module, a client id or MuJoCo's (model, data)"


def client_in(env: Any) -> Any:
    """Return the BulletClient, client id, pybullet module or (model, data) of a gymnasium environment, or None.

    Raises
    ------
    SceneError
        Several are equally near.
    """
    depth = 3  # Levels of attributes that are searched: env.robot.sim.physics_client is the third
    level, seen = [env.unwrapped], {id(env.unwrapped)}
    numbers: dict[int, None] = {}
    module = None
    for _ in range(depth):
        clients: dict[int, Any] = {}
        below = []
        for pair in (mujoco_pair([value for _, value in _parts(thing)]) for thing in level):
            if pair is not None:
                clients[id(pair[1])] = pair
        for name, value in (part for thing in level for part in _parts(thing)):
            if bullet_client(value):
                clients[id(value)] = value
            elif isinstance(value, int):
                if "client" in name.lower() and connected_number(value):
                    numbers[int(value)] = None
            elif inspect.ismodule(value):
                module = value if value.__name__ == "pybullet" else module
            elif id(value) not in seen:
                seen.add(id(value))
                below.append(value)
        if clients:
            kinds = "simulators" if any(map(is_mujoco, clients.values())) else "PyBullet clients"
            return _only(list(clients.values()), kinds)
        level = below
    return _only(list(numbers), "client ids") if numbers else module


def _only(found: list[Any], what: str) -> Any:
    if len(found) > 1:
        raise SceneError(f"the environment has {len(found)} {what}", GIVE_CLIENT)
    return found[0]


def _parts(thing: Any) -> Iterator[tuple[str, Any]]:
    """Yield the parts of an object by name."""
    if isinstance(thing, Mapping):
        yield from ((str(name), value) for name, value in thing.items())
    elif isinstance(thing, list | tuple):
        yield from (("", value) for value in thing)
    elif not inspect.isclass(thing) and not inspect.isroutine(thing):
        yield from getattr(thing, "__dict__", {}).items()
