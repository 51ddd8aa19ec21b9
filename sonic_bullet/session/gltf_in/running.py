"""A glTF scene, run with a listener on it.

file -> RigidScene -> bodies of a simulator -> models and materials to the listener -> steps -> notes
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any

from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Microphone
from sonic_bullet.records.rigid_scene import RigidScene
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session.gltf_in.scene_reader import read_rigid_scene
from sonic_bullet.session.links_of_script import add_links, named_links
from sonic_bullet.session.scene_steps import DEFAULT_SECONDS, SceneStage
from sonic_bullet.simulators import direct_client, is_static, watch_settings


def run_gltf(stage: SceneStage, seconds: float | None) -> tuple[str, ...]:
    """Run it for so many seconds of physics time; notes a user should read. Raises SonicBulletError."""
    from sonic_bullet.simulators.pybullet.rigid.rigid_world import build_rigid_scene

    scene = read_rigid_scene(stage.path)
    stage.client = client = direct_client()
    watch_settings(client)
    ids, act, notes = build_rigid_scene(client, scene)
    places: MicrophoneLike = stage.microphones if stage.microphones is not None else DEFAULT_MICROPHONE
    heard: tuple[str, ...] = ()
    if stage.microphones is None and scene.viewpoint is not None:
        view = scene.viewpoint
        bearer = ids[view.body] if view.body >= 0 else None
        places = (Microphone(view.position_m, view.quaternion_xyzw, body_id=bearer),)
        at = ", ".join(f"{x:.3g}" for x in view.position_m)
        whose = f" of {scene.bodies[view.body].name}" if view.body >= 0 else ""
        heard = (f"it is heard from its camera {view.name}, at ({at}) m{whose}",)
    stage.microphones = None
    stage.listener = listener = stage.attach_listener(client, places)
    for body_id, body in zip(ids, scene.bodies, strict=True):
        listener.world.call(body_id, -1, body.name)
    listener.add_all(_cast(scene, ids))
    _add_partners(stage, scene, ids)
    said: tuple[str, ...] = ()
    if stage.choice:
        stage.check_names()
        static = partial(is_static, client._client)
        said = add_links(listener, named_links(listener.world, stage.choice), static)
    stage.ready()
    total = seconds if seconds is not None else DEFAULT_SECONDS
    while listener.time_s < total - 1e-9:
        act()
        client.stepSimulation()
        report_fraction(min(listener.time_s / total, 1.0))
    return (*scene.notes, *notes, *heard, *said, *_ultrasonic(scene, listener.sr))


def _cast(scene: RigidScene, ids: list[int]) -> dict[int, dict[str, Any]]:
    """Who rings, as `Listener.add` wants it; what a file's model loses is in its decays, wherever it stands."""
    cast: dict[int, dict[str, Any]] = {}
    for body_id, body in zip(ids, scene.bodies, strict=True):
        if body.model is not None:
            cast[body_id] = {
                "material": body.material,
                "model": body.model,
                "name": body.name,
                "mounting": body.mounting,
            }
        elif body.solved:
            cast[body_id] = {"material": body.material, "name": body.name}
    return cast


def _add_partners(stage: SceneStage, scene: RigidScene, ids: list[int]) -> None:
    """Who touches and does not ring, with what its contacts are made of; and whose sound has a gain."""
    quietest_db = -200.0
    world = stage.need_listener().world
    for body_id, body in zip(ids, scene.bodies, strict=True):
        if body.material is not None and body.model is None and not body.solved:
            world.add(body_id, -1, material=body.material)
        if body.gain != 1:
            stage.gain_db[body_id] = max(20 * math.log10(body.gain), quietest_db) if body.gain > 0 else quietest_db


def _ultrasonic(scene: RigidScene, sr: int) -> list[str]:
    """Write a line for each body with modes that a rate cannot hold."""
    found = []
    for body in scene.bodies:
        if body.model is not None and (above := int((body.model.freq_hz >= sr / 2).sum())):
            found.append(f"{body.name}: {above} of {body.model.mode_count} modes are at or above {sr / 2:g} Hz: silent")
    return found
