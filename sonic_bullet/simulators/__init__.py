"""Read bodies, poses, contacts and step lengths of a simulator as values.

`world` defines what a simulator has to provide; the package `pybullet` implements it.

Every name is imported when first used.

    world = open_world(client)          BulletClient, the pybullet module, or a client id
    world.hook(before, after)           or, with the raw module, world.after_step() after each stepSimulation
    step = world.after_step()           -> contacts.Step
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sonic_bullet.simulators.pybullet.clients import (
        bodies_called,
        client_id_of,
        direct_client,
        disconnect,
        is_bullet_client,
        is_connected,
        is_static,
        links_called,
        links_with_shapes,
        open_world,
        watch_settings,
    )
    from sonic_bullet.simulators.pybullet.colliding.given_bodies import kept_reduced_bodies
    from sonic_bullet.simulators.pybullet.doctor import diagnose_world
    from sonic_bullet.simulators.pybullet.findings import Finding
    from sonic_bullet.simulators.pybullet.hooks import module_steps, seen_moves, seen_settings
    from sonic_bullet.simulators.pybullet.poses import body_ids
    from sonic_bullet.simulators.pybullet.pybullet_world import PyBulletWorld
    from sonic_bullet.simulators.pybullet.restitution import endless_bounces, keep_restitution
    from sonic_bullet.simulators.pybullet.scene_clock import SceneClock, running_clock, scene_clock
    from sonic_bullet.simulators.pybullet.script import own_clients, run_script
    from sonic_bullet.simulators.world import World

__all__ = [
    "Finding",
    "PyBulletWorld",
    "SceneClock",
    "World",
    "bodies_called",
    "body_ids",
    "client_id_of",
    "diagnose_world",
    "direct_client",
    "disconnect",
    "endless_bounces",
    "is_bullet_client",
    "is_connected",
    "is_static",
    "keep_restitution",
    "kept_reduced_bodies",
    "links_called",
    "links_with_shapes",
    "module_steps",
    "open_world",
    "own_clients",
    "run_script",
    "running_clock",
    "scene_clock",
    "seen_moves",
    "seen_settings",
    "watch_settings",
]


def __getattr__(name: str) -> Any:
    home = {
        "Finding": "pybullet.findings",
        "PyBulletWorld": "pybullet.pybullet_world",
        "World": "world",
        "bodies_called": "pybullet.clients",
        "body_ids": "pybullet.poses",
        "client_id_of": "pybullet.clients",
        "diagnose_world": "pybullet.doctor",
        "direct_client": "pybullet.clients",
        "disconnect": "pybullet.clients",
        "endless_bounces": "pybullet.restitution",
        "is_bullet_client": "pybullet.clients",
        "is_connected": "pybullet.clients",
        "is_static": "pybullet.clients",
        "kept_reduced_bodies": "pybullet.colliding.given_bodies",
        "keep_restitution": "pybullet.restitution",
        "links_called": "pybullet.clients",
        "links_with_shapes": "pybullet.clients",
        "module_steps": "pybullet.hooks",
        "open_world": "pybullet.clients",
        "own_clients": "pybullet.script",
        "run_script": "pybullet.script",
        "running_clock": "pybullet.scene_clock",
        "SceneClock": "pybullet.scene_clock",
        "scene_clock": "pybullet.scene_clock",
        "seen_moves": "pybullet.hooks",
        "seen_settings": "pybullet.hooks",
        "watch_settings": "pybullet.clients",
    }
    if name in home:
        return getattr(importlib.import_module(f"sonic_bullet.simulators.{home[name]}"), name)
    raise AttributeError(f"module 'sonic_bullet.simulators' has no attribute '{name}'")
