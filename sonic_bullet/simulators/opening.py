"""Find the simulator that a client belongs to, and open its world; each is imported when first used."""

from __future__ import annotations

import sys
from typing import Any

from sonic_bullet.simulators.world import World


def is_mujoco(client: Any) -> bool:
    """Tell whether a client is a pair of MuJoCo's model and data."""
    if not isinstance(client, (tuple, list)) or len(client) != 2:
        return False
    pair = mujoco_pair(list(client))
    return pair is not None and pair[0] is client[0]


def mujoco_pair(things: list[Any]) -> tuple[Any, Any] | None:
    """Return the only MjModel and MjData among some objects, None where there is not one of each."""
    mujoco = sys.modules.get("mujoco")
    if mujoco is None:
        return None
    models, datas = ([one for one in things if isinstance(one, kind)] for kind in (mujoco.MjModel, mujoco.MjData))
    return (models[0], datas[0]) if len(models) == len(datas) == 1 else None


def bullet_client(thing: Any) -> bool:
    """Tell whether an object is a connected BulletClient; False where PyBullet was never imported."""
    if sys.modules.get("pybullet") is None:
        return False
    from sonic_bullet.simulators.pybullet.clients import is_bullet_client

    return is_bullet_client(thing)


def connected_number(number: int) -> bool:
    """Tell whether a number is the id of a connected PyBullet client; False where PyBullet was never imported."""
    if sys.modules.get("pybullet") is None:
        return False
    from sonic_bullet.simulators.pybullet.clients import is_connected

    return is_connected(number)


def open_simulator(client: Any) -> World:
    """Open the world of a BulletClient, the pybullet module, a client id, or MuJoCo's (model, data).

    Raises
    ------
    SceneError
        It is none of them, or nothing is connected there.
    """
    if is_mujoco(client):
        from sonic_bullet.simulators.mujoco.mujoco_world import MujocoWorld

        return MujocoWorld(*client)
    from sonic_bullet.simulators.pybullet.clients import open_world

    return open_world(client)
