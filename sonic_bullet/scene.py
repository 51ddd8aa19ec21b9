"""Scenes from files: render one, or find what would spoil its sound.

    scenes/NAME.py -> (build(client) -> cast | plain script) -> Listener -> RenderResult

A scene is an ordinary Python file of one of two kinds, without base classes. `build(client)` sets a world up and
returns its cast, a dictionary from a body (or (body, link), or (body, "all")) to its material, or to the keywords of
`Listener.add`. The file may also hold `SECONDS`, `MICROPHONE` and `act(client, time_s)`, called before every step. A
plain script connects, loads and steps as any PyBullet script does; windows become DIRECT, sleeps are skipped, and the
clock that it reads is the simulation's (`simulators.pybullet.scene_clock`). Where it
attaches a listener of its own (kept in a top-level name), that one is used; otherwise every body that it loads sounds
as ``material``. A .gltf or .glb with KHR_physics_rigid_bodies is a scene, too (`session.gltf_in`).
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from sonic_bullet.engine.runtime.replay import as_tail_db, render_kept, render_notes
from sonic_bullet.files import check_sr
from sonic_bullet.files.contact_log import ContactLog
from sonic_bullet.files.storage.spooled_sound import KeptSound
from sonic_bullet.machine.progress import show_progress, without_progress
from sonic_bullet.machine.worker import running_scene
from sonic_bullet.options.option import takes
from sonic_bullet.options.render import DEFAULT_SR, PlaySceneOptions, RenderSceneOptions, SceneOptions
from sonic_bullet.records import Array, Sensor
from sonic_bullet.records.coerce import as_call, as_path, quote
from sonic_bullet.records.errors import SceneError, SceneWarning, SonicBulletError, interrupts
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session import Listener, attach
from sonic_bullet.session.arguments import as_sensors
from sonic_bullet.session.gltf_in.running import run_gltf
from sonic_bullet.session.gltf_in.scene_reader import is_gltf
from sonic_bullet.session.material_choice import MaterialChoice, choice_of, draft_notes, use_choice
from sonic_bullet.session.scene_file import defines_build
from sonic_bullet.session.scene_findings import find_clock_loops, find_mute_bodies, find_nothing_added, find_real_time
from sonic_bullet.session.scene_steps import as_seconds, run_built, run_plain
from sonic_bullet.simulators import (
    Finding,
    SceneClock,
    diagnose_world,
    own_clients,
    scene_clock,
    seen_settings,
)  # fmt: skip

Receive = Callable[[tuple[Sensor, ...]], tuple[Sensor, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class RenderResult:
    """Sound (channels, n) in pascals, in memory or on disk, its log, and notes. lifted: see `Listener.lifted`."""

    sound: KeptSound
    log: ContactLog
    sr: int
    notes: tuple[str, ...] = ()
    lifted: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @property
    def samples(self) -> Array:
        """The whole sound (channels, n)."""
        return self.sound.samples()


@show_progress(in_percent=True)
@takes(RenderSceneOptions)
def render_scene(path: str | Path, options: RenderSceneOptions) -> RenderResult:
    """Run a scene for ``seconds`` of physics time and return its sound.

    The options are keywords: ``render_scene("drop.py", seconds=2)``. materials: of bodies and links by name, before
    ``material``. at_start, at_end: called with the listener before the first step, and after the last while its world
    exists. tail_db: level below the peak at which the decay after the last step ends, -60 say, at most 10 s; None, 0:
    no decay. Raises SonicBulletError; where the scene fails or is interrupted, the exception carries the sound so far
    as ``partial``.
    """
    asked = _check_options(options)
    asked |= {name: True if (value := getattr(options, name)) is None else value for name in ("residual", "supports")}
    asked |= {
        "image": options.image,
        "at_start": as_call(options.at_start, "at_start"),
    }
    at_end, tail_db = as_call(options.at_end, "at_end"), as_tail_db(options.tail_db)
    with _stage(path, **asked) as stage:
        try:
            with interrupts():
                notes = stage.run(options.seconds)
                if at_end is not None:
                    at_end(stage.need_listener())
        except (SonicBulletError, KeyboardInterrupt) as error:
            with suppress(SonicBulletError):  # a script's own listener may keep nothing
                error.partial = stage.result(()) if stage.listener is not None else None  # type: ignore[union-attr]
            raise
        return stage.result((*notes, *stage.check_names()), tail_db)


@takes(PlaySceneOptions, 2)
def run_scene(path: str | Path, begin: Callable[[Listener], object], options: PlaySceneOptions) -> tuple[str, ...]:
    """Run a scene whose listener is passed to ``begin`` before its first step; return notes for the user.

    The options are keywords. receive: makes of its sensors those that it has instead. Raises SonicBulletError,
    SceneError also for microphones where a script's own listener has its own.
    """
    asked = _check_options(options) | {"receive": as_call(options.receive, "receive")}
    with _stage(path, **asked, begin=begin) as stage, interrupts():
        notes = stage.run(options.seconds)
        return (*notes, *stage.check_names(), *stage.need_listener().notes)


def _check_options(options: SceneOptions) -> dict[str, Any]:
    """Check what every run of a scene is asked for."""
    return {
        "sr": check_sr(DEFAULT_SR if options.sr is None else options.sr),
        "seed": options.seed or 0,
        "microphones": None if options.microphones is None else as_sensors(options.microphones, "microphones"),
        "choice": choice_of(options),
        "chosen_client": options.client,
    }


def examine_scene(path: str | Path, seconds: float = 1.0, *, client: int | None = None) -> tuple[Finding, ...]:
    """Find what in a scene would spoil its sound, and the remedies.

    Runs it for ``seconds`` of physics time. client: id of the one examined; None: the first that steps. Raises
    SonicBulletError.
    """
    quiet = _stage(path, sr=8_000, seed=0, microphones=(), chosen_client=client)  # no sensor: contacts alone
    with quiet as stage, seen_settings() as seen:
        stage.run(as_seconds(seconds, "seconds"))
        listener = stage.need_listener()
        looks, real_time = ({}, ()) if stage.clock is None else (stage.clock.looks, stage.clock.real_time)
        return (
            *diagnose_world(listener.world, seen=seen),
            *find_nothing_added(listener),
            *find_mute_bodies(listener),
            *find_clock_loops(looks),
            *find_real_time(real_time),
        )


@dataclass(slots=True)
class _Stage:
    """A scene being run: its file, and its listener. adds: the script chose the bodies of its own listener."""

    path: Path
    sr: int
    seed: int
    microphones: tuple[Sensor, ...] | None
    choice: MaterialChoice = field(default_factory=MaterialChoice)
    residual: bool = True
    supports: bool = True
    image: bool | None = None
    begin: Callable[[Listener], object] | None = None
    at_start: Callable[[Listener], object] | None = None
    receive: Receive | None = None
    listener: Listener | None = None
    adds: bool = False
    client: Any = None
    gain_db: dict[int, float] = field(default_factory=dict)
    folder: str | None = None
    clock: SceneClock | None = None
    chosen_client: int | None = None
    clients: ExitStack = field(default_factory=ExitStack)

    def __enter__(self) -> _Stage:
        with suppress(OSError):
            self.folder = os.getcwd()
        self.clients.enter_context(own_clients())
        return self

    def __exit__(self, *_: object) -> None:
        if self.folder is not None:  # a scene may change it
            with suppress(OSError):
                os.chdir(self.folder)
        if self.listener is not None:
            self.listener.detach()
        self.clients.close()

    def run(self, seconds: float | None) -> tuple[str, ...]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SceneWarning)  # they are in the result's notes
            run = run_gltf if is_gltf(self.path) else run_built if defines_build(self.path) else run_plain
            with running_scene(self.path), use_choice(self.choice), scene_clock(self.path) as self.clock:
                return run(self, seconds)

    def attach_listener(self, client: Any, microphones: MicrophoneLike) -> Listener:
        """Attach a listener that keeps log and sound, unless it is played at once."""
        how: dict[str, Any] = dict.fromkeys(("keep_log", "keep_sound"), self.begin is None)
        if self.receive is not None:
            microphones, self.receive = self.receive(as_sensors(microphones, "microphones")), None
        how |= {"supports": self.supports, "image": bool(self.image)}
        return attach(client, sr=self.sr, seed=self.seed, microphone=microphones, **how)

    def ready(self) -> None:
        """Call `begin` and `at_start`, once, with the listener that has its bodies."""
        waiting, self.begin, self.at_start = (self.begin, self.at_start), None, None
        for call in waiting:
            if call is not None:
                call(self.need_listener())

    def need_listener(self) -> Listener:
        if self.listener is None:
            raise SceneError(f"scene '{self.path.name}' made no physics step", "call stepSimulation in it")
        return self.listener

    def check_names(self) -> tuple[str, ...]:
        """Return lines on silenced bodies that are silent anyway; SceneError where a chosen name is of no body."""
        world = self.need_listener().world
        if self.choice:
            here = world.record_names([(*who, None) for who in world.all_links()])
            self.choice.check_names([*here, *(body.name for body in world.bodies)], f"scene '{self.path.name}'")
            if self.adds:
                self.choice.check_added([body.name for body in world.bodies if body.material], self.path.name)
        return self.choice.silent_notes(world.bodies)

    def result(self, notes: tuple[str, ...], tail_db: float | None = None) -> RenderResult:
        listener = self.need_listener()
        listener.finish()
        contacts = listener.contacts
        notes = (*notes, *listener.left_out, *draft_notes(contacts))
        log = replace(contacts, residual=self.residual, supports=listener.supports and self.supports)
        log = replace(log, image=listener.image if self.image is None else self.image)
        if self.gain_db:
            louder = tuple(replace(body, gain_db=self.gain_db.get(body.body_id, 0.0)) for body in log.bodies)
            log = replace(log, bodies=louder)
        if (
            not self.gain_db
            and listener.sr == self.sr
            and listener.keeps_sound
            and self.microphones is None
            and (listener.supports, listener.image) == (log.supports, log.image)
            and (self.residual or not any(b.material and b.material.residual for b in log.bodies))
        ):
            sound = listener.kept_sound(tail_db=tail_db)
            return RenderResult(sound, log, self.sr, (*notes, *render_notes(sound, log)), listener.lifted)
        log = replace(log, sr=self.sr, sensors=log.sensors if self.microphones is None else self.microphones)
        with without_progress():
            sound = render_kept(log, tail_db=tail_db)
        lifted = listener.lifted if log.supports else {}
        return RenderResult(sound, log, self.sr, (*notes, *render_notes(sound, log)), lifted)


def _stage(path: str | Path, **options: Any) -> _Stage:
    remedy = "give the path of a Python scene"
    name = as_path(path, "path", remedy, error=SceneError)
    try:
        place = Path(name).resolve(strict=True)
    except (OSError, ValueError):  # missing, or not a valid name
        raise SceneError(f"no scene file {quote(name)}", remedy) from None
    if not place.is_file():
        raise SceneError(f"{quote(name)} is {'a folder' if place.is_dir() else 'no file'}, not a scene", remedy)
    return _Stage(place, **options)
