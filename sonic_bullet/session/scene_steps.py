"""The steps of a scene, made with a listener on it: of a file with `build`, and of a plain script.

stage (file, microphones, choice of materials) -> world -> listener -> steps -> notes
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol

from sonic_bullet.machine.progress import report_fraction
from sonic_bullet.options.render import DEFAULT_MICROPHONE
from sonic_bullet.records import Sensor
from sonic_bullet.records.coerce import as_number
from sonic_bullet.records.errors import RestitutionWarning, SceneError
from sonic_bullet.records.sensors import MicrophoneLike
from sonic_bullet.session.arguments import as_material
from sonic_bullet.session.links_of_script import add_links, named_links
from sonic_bullet.session.listening import Listener
from sonic_bullet.session.material_choice import MaterialChoice
from sonic_bullet.session.scene_file import scene_module, user_code, uses_sonic_bullet
from sonic_bullet.simulators import (
    PyBulletWorld,
    body_ids,
    direct_client,
    endless_bounces,
    is_static,
    kept_reduced_bodies,
    links_with_shapes,
    module_steps,
    run_script,
    running_clock,
    seen_moves,
    seen_settings,
    watch_settings,
)
from sonic_bullet.simulators.properties import SetValues

DEFAULT_SECONDS = 4.0


class SceneStage(Protocol):
    """A scene being run. adds: a script chose whom its own listener listens to; gain_db: by bodies' ids."""

    path: Path
    microphones: tuple[Sensor, ...] | None
    receive: Any
    choice: MaterialChoice
    begin: Callable[[Listener], object] | None
    at_start: Callable[[Listener], object] | None
    listener: Listener | None
    adds: bool
    client: Any
    chosen_client: int | None
    gain_db: dict[int, float]

    def attach_listener(self, client: Any, microphones: MicrophoneLike) -> Listener:
        """Make a listener on a client."""
        ...

    def ready(self) -> None:
        """Tell that the listener knows its bodies."""
        ...

    def need_listener(self) -> Listener:
        """Return the listener; raises SceneError where there is none."""
        ...

    def check_names(self) -> tuple[str, ...]:
        """Lines on names of the choice."""
        ...


def as_seconds(seconds: object, name: str) -> float:
    """Return a length of physics time; raises SceneError."""
    return as_number(seconds, name, "give seconds of physics time, above 0", above=0, most=1e6, error=SceneError)


def run_built(stage: SceneStage, seconds: float | None) -> tuple[str, ...]:
    """Run a file with `build` for so many seconds of physics time; notes a user should read."""
    module = scene_module(stage.path)
    stage.client = client = direct_client()  # dropped, it would end before its world is looked at
    with module_steps(client._client, partial(_tell_clock, client)):
        return _run_built(stage, module, seconds)


def _tell_clock(client: Any) -> None:
    """Let the scene's clock know of a step; one that nobody reads needs not."""
    clock = running_clock()
    if clock is not None and clock.looks:
        clock.step(client.getPhysicsEngineParameters()["fixedTimeStep"])


def _run_built(stage: SceneStage, module: ModuleType, seconds: float | None) -> tuple[str, ...]:
    client = stage.client
    watch_settings(client)  # build sets friction and the like
    cast = user_code(stage.path, module.build, client)
    if not isinstance(cast, dict):
        what = f"scene '{stage.path.name}': build(client) returned {type(cast).__name__}"
        raise SceneError(what, "return a dictionary from bodies to materials")
    places = stage.microphones if stage.microphones is not None else getattr(module, "MICROPHONE", DEFAULT_MICROPHONE)
    stage.listener = listener = stage.attach_listener(client, places)
    stage.microphones = None
    user_code(stage.path, partial(listener.add_all, cast))
    said: tuple[str, ...] = ()
    if stage.choice:
        stage.check_names()
        static = partial(is_static, client._client)
        said = add_links(listener, named_links(listener.world, stage.choice), static)
    act = getattr(module, "act", None)
    stage.ready()
    own = getattr(module, "SECONDS", DEFAULT_SECONDS)
    total = seconds if seconds is not None else as_seconds(own, f"SECONDS of scene '{stage.path.name}'")
    while listener.time_s < total - 1e-9:
        if act is not None:
            user_code(stage.path, act, client, listener.time_s)
        client.stepSimulation()
        report_fraction(min(listener.time_s / total, 1.0))
    return said


def run_plain(stage: SceneStage, seconds: float | None) -> tuple[str, ...]:
    """Run a script for so many seconds of physics time; notes a user should read."""
    default_material = "plastic"
    total = seconds if seconds is not None else DEFAULT_SECONDS
    if uses_sonic_bullet(stage.path):
        names: dict[str, Any] = {}

        def look(_: int) -> None:
            stage.listener = stage.listener or _listener_in(names)
            if (stage.begin or stage.at_start) is not None and stage.listener is not None:
                if stage.begin is not None and (stage.microphones, stage.receive) != (None, None):
                    raise SceneError(f"scene '{stage.path.name}' has microphones of its own", "leave yours out")
                stage.ready()

        try:
            run_script(stage.path, (look, None), total, names=names, client=stage.chosen_client)
        finally:  # where it fails, the sound so far is kept too
            stage.listener = _listener_in(names)
        stage.adds = True
        if stage.listener is None:
            what = f"scene '{stage.path.name}' imports sonic_bullet but keeps no listener in a top-level name"
            raise SceneError(what, "write listener = sonic_bullet.attach(...)")
        return ()
    material = stage.choice.everyone or as_material(default_material)
    places = stage.microphones if stage.microphones is not None else DEFAULT_MICROPHONE
    stage.microphones = None
    known: set[int] = set()
    said: list[str] = []

    def world_of(client: int) -> PyBulletWorld | None:
        world = None if stage.listener is None else stage.listener.world
        return world if isinstance(world, PyBulletWorld) and world.client_id == client else None

    def before(client: int) -> None:
        if stage.listener is None:
            stage.listener = stage.attach_listener(client, places)
            for one in endless_bounces(client, seen.get(client, SetValues())):
                warnings.warn(f"{one.what}; {one.remedy}", RestitutionWarning, stacklevel=2)
        came = [body for body in body_ids(client) if body not in known]
        known.update(came)
        with kept_reduced_bodies():
            if new := [who for body in came for who in links_with_shapes(client, body)]:
                said.extend(add_links(stage.listener, dict.fromkeys(new, material), partial(is_static, client)))
        stage.ready()
        world = world_of(client)
        if world is not None:
            world.before_step()  # so that what is set by hand is known by its poses

    def after(_: int) -> None:
        stage.need_listener().take_step()

    others: Counter[int] = Counter()
    with seen_settings() as seen, seen_moves(world_of):
        run_script(stage.path, (before, after), total, client=stage.chosen_client, others=others)
    said += _other_clients(others, stage.chosen_client)
    apart = ", ".join(f"{name} as {one.name}" for name, one in stage.choice.named.items())
    but = f", but {apart}" if apart else ""
    return (f"every body sounds as {material.name}{but}: the script names no materials", *said)


def _other_clients(others: Counter[int], chosen: int | None) -> list[str]:
    """Return a note on the clients that step and are not heard."""
    if not others:
        return []
    which = ", ".join(map(str, sorted(others)))
    are = ("s", "", "are") if len(others) > 1 else ("", "s", "is")
    heard = "the first that stepped is" if chosen is None else f"client {chosen} is"
    return [
        f"physics client{are[0]} {which} of the script step{are[1]} too and {are[2]} not heard: {heard}; "
        f"--client {min(others)} listens to another"
    ]


def _listener_in(names: dict[str, Any]) -> Listener | None:
    return next((value for value in names.values() if isinstance(value, Listener)), None)
