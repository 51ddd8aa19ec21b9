"""A scene or a contact log as one glTF: run or read, baked, written whole or not at all."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sonic_bullet.apps.cli.output import status
from sonic_bullet.apps.cli.scenes.scene_runs import is_log
from sonic_bullet.machine.progress import report_progress
from sonic_bullet.options.render import SceneOptions
from sonic_bullet.records import Body
from sonic_bullet.records.counts import format_count
from sonic_bullet.records.errors import AudioError, FileError

if TYPE_CHECKING:
    from sonic_bullet.apps.bake import BakedModel, PruningOptions
    from sonic_bullet.apps.bake.scene_out.emitters import BodyClip
    from sonic_bullet.apps.bake.scene_out.scene_tree import BodySound
    from sonic_bullet.session import Listener
    from sonic_bullet.simulators.pybullet.rigid.world_scene import StandingScene


def write_whole_scene(
    to: str,
    source: str,
    materials: SceneOptions,
    pruning: PruningOptions,
    seconds: float | None,
    *,
    emitters: bool = False,
) -> tuple[list[BakedModel], str, tuple[str, ...]]:
    """Write it; return its models, a line on the rest, and notes. Raises SonicBulletError.

    emitters: with clips for viewers that play no modes.
    """
    from sonic_bullet.apps.bake.scene_out.recorded_scene import recorded_scene
    from sonic_bullet.apps.bake.scene_out.scene_tree import write_scene
    from sonic_bullet.apps.cli.solids.bake_outputs import scene_log

    standing: list[StandingScene] = []
    looks = [lambda listener: standing.append(_world_of(listener))] * 2
    log = scene_log(source, materials, seconds, *looks)
    if is_log(source) and seconds is not None:
        if seconds > log.duration_s + 1e-9:
            raise AudioError(f"{source} lasts {log.duration_s:.3f} s, shorter than {seconds} s", "give fewer seconds")
        log = log.first(int((log.start_s < seconds - 1e-9).sum()))
    world = standing[0] if standing else None
    made = recorded_scene(log, *((world.scene, world.links) if world is not None else ()))
    if not any(body is not None and body.model is not None and body.model.mode_count for body in made.members):
        raise FileError(f"no body of {source} has modes", "give one a material that rings")
    with status(source):
        sounds: list[BodySound] = []
        for body in made.members:
            report_progress("" if body is None else body.name)
            sounds.append(_sound_of(body, pruning))
    unrecorded = _name_unrecorded(standing, {(body.body_id, body.link) for body in made.members if body is not None})
    clips: tuple[BodyClip, ...] = ()
    if emitters:
        from sonic_bullet.apps.bake.scene_out.emitters import render_clips

        with status(source):
            clips = render_clips(log, made.members)
    notes = (*made.scene.notes, *unrecorded, *write_scene(to, made.scene, sounds, clips))
    scene = made.scene
    joints = f", {format_count(len(scene.joints), 'joint')}" if scene.joints else ""
    line = (
        f"{Path(to).name}: {format_count(len(scene.bodies), 'body', 'bodies')}{joints}, "
        f"{log.duration_s:.3g} s of motion of {len(scene.paths)}"
        f"{', ' + format_count(len(clips), 'emitter') if emitters else ''}"
    )
    return [one.model for one in sounds if one.model is not None], line, notes


def _name_unrecorded(standing: list[StandingScene], recorded: set[tuple[int, int]]) -> tuple[str, ...]:
    """Name who moved from the first look at the world to the last, and is in no record of the log."""
    if len(standing) < 2:
        return ()
    last = dict(zip(standing[-1].links, standing[-1].scene.bodies, strict=True))
    moved = [
        body.name
        for link, body in zip(standing[0].links, standing[0].scene.bodies, strict=True)
        if link in last and link not in recorded and (body.position_m != last[link].position_m).any()
    ]
    if not moved:
        return ()
    who = moved[0] + (f" and {len(moved) - 1} more" if len(moved) > 1 else "")
    return (f"motion of {who} is not in the file: a contact log has that of who sounds or is touched",)


def _world_of(listener: Listener) -> StandingScene:
    from sonic_bullet.simulators import PyBulletWorld
    from sonic_bullet.simulators.pybullet.rigid.world_scene import read_world_scene

    assert isinstance(listener.world, PyBulletWorld)  # scenes run in PyBullet
    return read_world_scene(listener.world.client_id, listener.world.record_names)


def _sound_of(body: Body | None, pruning: PruningOptions) -> BodySound:
    from sonic_bullet.apps.bake import bake_body
    from sonic_bullet.apps.bake.baking import bake_material
    from sonic_bullet.apps.bake.scene_out.scene_tree import BodySound

    if body is None or body.material is None:
        return BodySound()
    gain = 0.0 if body.silent else body.gain
    if body.model is not None and body.model.mode_count:
        return BodySound(bake_body(body, pruning), bake_material(body.material), gain, body.mounting)
    return BodySound(None, bake_material(body.material), gain)
