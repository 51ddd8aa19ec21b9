"""listener: the room that hears PyBullet, and the only one that imports it. Everything is imported when first used.

world = open_world(client)          BulletClient, the pybullet module, or a client id
world.hook(before, after)           or, with the raw module, world.after_step() after each stepSimulation
step = world.after_step()           -> contacts.Step
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.listener.pybullet.clients import direct_client, disconnect, links_called, links_with_shapes
    from sonic_bullet.listener.pybullet.doctor import Finding, diagnose_world, keep_restitution
    from sonic_bullet.listener.pybullet.script import run_script
    from sonic_bullet.listener.pybullet.world import World, open_world

__all__ = [
    "Finding",
    "World",
    "diagnose_world",
    "direct_client",
    "disconnect",
    "keep_restitution",
    "links_called",
    "links_with_shapes",
    "open_world",
    "run_script",
]

_HOME = {
    "Finding": "doctor",
    "World": "world",
    "diagnose_world": "doctor",
    "direct_client": "clients",
    "disconnect": "clients",
    "keep_restitution": "doctor",
    "links_called": "clients",
    "links_with_shapes": "clients",
    "open_world": "world",
    "run_script": "script",
}


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(importlib.import_module(f"sonic_bullet.listener.pybullet.{_HOME[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet.listener' has no attribute '{name}'")
