"""Options of a scene or a contact log, and its run or replay, for `render`, `film` and `play`."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from sonic_bullet.apps.cli.output import quiet_stderr
from sonic_bullet.options.option import keywords
from sonic_bullet.options.render import DEFAULT_SR, RenderSceneOptions, SceneOptions
from sonic_bullet.records.errors import AudioError, FileError, SonicBulletError
from sonic_bullet.records.file_endings import SCENE_ENDINGS
from sonic_bullet.records.regular_files import check_regular

if TYPE_CHECKING:
    from sonic_bullet.engine.path.room.room_plan import RoomPlan
    from sonic_bullet.files.contact_log import ContactLog
    from sonic_bullet.files.storage.spooled_sound import KeptSound
    from sonic_bullet.records import RoomResponse, ShoeboxRoom
    from sonic_bullet.scene import RenderResult
    from sonic_bullet.session import Listener
    from sonic_bullet.simulators.pictures import PlacedLink

    Room = ShoeboxRoom | RoomResponse | None

Scene = TypeVar("Scene", bound=SceneOptions)


def is_log(scene: str) -> bool:
    """Tell by its name whether a scene is a contact log."""
    return Path(scene).suffix.lower() == ".npz"


def check_scene_file(scene: str, verb: str) -> None:
    """Raise FileError where there is neither a scene nor a contact log to render or play."""
    check_regular(scene, "give a scene (.py .gltf .glb) or a contact log (.npz)")
    if Path(scene).suffix.lower() not in (*SCENE_ENDINGS, ".npz"):
        raise FileError(
            f"cannot {verb} {scene}: neither a scene nor a contact log",
            "give a file that ends in .py, .gltf, .glb or .npz",
        )


def standing_collector(standing: list[PlacedLink]) -> Callable[[Listener], None]:
    """Return a function that, at a scene's end, lists the shapes of its silent partners, for a film."""

    def at_end(listener: Listener) -> None:
        from sonic_bullet.simulators import PyBulletWorld
        from sonic_bullet.simulators.pictures import standing_in

        if isinstance(listener.world, PyBulletWorld):
            standing.extend(standing_in(listener.world.client_id))

    return at_end


def checked_scene(scene: Scene) -> Scene:
    """Return the options with their rate checked, after every material was read once.

    Raises AudioError, MaterialError, FileError before anything runs.
    """
    from sonic_bullet.files import check_sr
    from sonic_bullet.files.presets import load_material

    for one in (scene.material, *(scene.materials or {}).values()):
        if isinstance(one, str | Path):
            load_material(one)
    return scene if scene.sr is None else replace(scene, sr=check_sr(scene.sr))


def run_scene(path: str, scene: RenderSceneOptions, *, feels_all: bool = False) -> RenderResult:
    """Run a scene. feels_all: bodies are felt that no microphone hears."""
    with quiet_stderr():
        from sonic_bullet.scene import render_scene
        from sonic_bullet.session.felt_bodies import feeling_all

    asked = replace(scene, sr=scene.sr or DEFAULT_SR, seed=scene.seed or 0)
    with feeling_all() if feels_all else nullcontext():
        return render_scene(path, **keywords(asked))


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A `RenderResult` of a log; that class needs PyBullet, a replay does not."""

    sound: KeptSound
    log: ContactLog
    sr: int
    notes: tuple[str, ...] = ()
    plan: RoomPlan | None = None


def replay_log(path: str, scene: RenderSceneOptions) -> Replay:
    """Render a log: bit for bit the render it came from, where no option changes it."""
    log, said = prepare_log(path, scene)
    return render_log(log, scene, said)


def prepare_log(path: str, scene: RenderSceneOptions) -> tuple[ContactLog, tuple[str, ...]]:
    """Return a log as it is to be rendered, and notes for the user."""
    from sonic_bullet.files import read_log
    from sonic_bullet.session.arguments import as_sensors
    from sonic_bullet.session.chosen_in_log import with_choice
    from sonic_bullet.session.material_choice import choice_of

    log, said = with_choice(read_log(path), choice_of(scene), path)
    if scene.microphones is not None:
        log = replace(log, sensors=as_sensors(scene.microphones, "microphones"))
    own = {name: getattr(scene, name) for name in ("seed", "residual", "supports", "image")}
    log = replace(log, **{name: value for name, value in own.items() if value is not None})
    if (seconds := scene.seconds) is not None:
        if seconds > log.duration_s + 1e-9:
            raise AudioError(
                f"{path} lasts {log.duration_s:.3f} s, shorter than {seconds} s",
                "give fewer seconds, or simulate the scene for longer",
            )
        log = log.first(int((log.start_s < seconds - 1e-9).sum()))
    return log, said


def render_log(log: ContactLog, scene: RenderSceneOptions, said: tuple[str, ...], room: Room = None) -> Replay:
    """Render a log as it is."""
    from sonic_bullet.engine.path.room import room_of
    from sonic_bullet.engine.runtime.replay import render_kept, render_notes

    rate, plan = scene.sr or log.sr, None
    if room is not None:
        plan = room_of(room, replace(log, sr=rate))
        said = (*said, plan.note)
    try:
        sound = render_kept(log, sr=scene.sr, tail_db=scene.tail_db, plan=plan)
    except (SonicBulletError, KeyboardInterrupt) as error:
        error.partial = Replay(error.kept, log, rate) if hasattr(error, "kept") else None  # type: ignore[union-attr]
        raise
    notes = tuple(dict.fromkeys((*said, *render_notes(sound, log))))
    return Replay(sound, log, rate, notes, plan)
