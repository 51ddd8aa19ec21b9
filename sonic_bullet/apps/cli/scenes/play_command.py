"""Command `play`: a scene or a contact log on a sound card while it runs, paced by the card."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from sonic_bullet.apps.cli.examples import EXAMPLES
from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.parameters import json_option, scene_options
from sonic_bullet.apps.cli.scenes.scene_runs import DEFAULT_SR, WantedMaterials, check_scene_file, is_log
from sonic_bullet.apps.cli.scenes.space_options import OPTIONS as SPACE_OPTIONS
from sonic_bullet.apps.cli.scenes.space_options import SpaceWish, space_options
from sonic_bullet.machine.progress import fraction_listener, progress_to, report_progress
from sonic_bullet.records.errors import AudioError, SceneError

if TYPE_CHECKING:
    from sonic_bullet.records import Sensor
    from sonic_bullet.session.live import Playback, PlaybackReport


@click.command(epilog=EXAMPLES["play"])
@click.argument("scene", metavar="SCENE.py|.gltf|LOG.npz")
@click.option(
    "--device", metavar="D", help="Name or number of a sound card; 'null' for none. [default: the system's own]"
)
@click.option("--seconds", type=float, metavar="S", help="How long. [default: the scene's own, else 4; all of a log]")
@click.option("--sr", type=float, metavar="HZ", help="Sample rate, 8000 … 384000. [default: 48000; a log's own]")
@click.option(
    "--full-scale",
    "full_scale_pa",
    type=float,
    metavar="PA",
    help="Pressure in Pa that is full scale: less is louder. What is beyond is clipped and counted. [default: 20]",
)
@click.option(
    "--ahead", "ahead_s", type=float, metavar="S", help="How much sound waits: how late a step may be. [default: 0.018]"
)
@scene_options
@space_options
@json_option
def play(scene: str, json_to: str | None, **options: Any) -> None:
    """Play a PyBullet scene, or a contact log, on a sound card while it runs."""
    card_options = ("device", "full_scale_pa", "ahead_s")
    path = Path(scene)
    check_scene_file(scene, "play")
    materials = WantedMaterials.read(*(options.pop(name) for name in ("material", "silent", "fill_modes", "draft")))
    space = SpaceWish.read(**{name: options.pop(name) for name in SPACE_OPTIONS})
    if not is_log(scene):
        space.check_live()
    (json_to,) = places(json_to)
    given = {name: value for name, value in options.items() if value not in (None, ())}
    if given.get("device", "").isdecimal():
        given["device"] = int(given["device"])
    with clean_stdout(json_to) as echo:
        with progress_bar(path.name):
            show = _Show({name: given.pop(name) for name in card_options if name in given})
            try:
                notes = (_play_log if is_log(scene) else _play_scene)(scene, given, materials, space, show)
            except KeyboardInterrupt as error:
                said = [str(error) or "stopped", *([str(show.report)] if show.playback is not None else [])]
                raise KeyboardInterrupt("; ".join(said)) from error
        echo(str(show.report))
        for note in notes:
            print(f"sonic-bullet: note: {note}", file=sys.stderr)
    known = asdict(show.report)
    write_json(json_to, {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in known.items()})


class _Show:
    """A playback, and the line on a terminal that shows its progress."""

    def __init__(self, card: dict[str, Any]) -> None:
        self.card, self._draw, self._drawn_s = card, fraction_listener(), 0.0
        self.playback: Playback | None = None

    @property
    def report(self) -> PlaybackReport:
        if self.playback is None:
            raise SceneError("the scene made no physics step", "call stepSimulation in it")
        return self.playback.report

    def __call__(self, share: float) -> None:
        """Show the fraction done, seldom, as that takes time from the physics; raise the failure of the card."""
        refresh_s = 0.25  # of the line on a terminal
        if self.playback is not None and self.playback.failure is not None:
            failure = self.playback.failure
            raise AudioError(failure.what, f"{failure.remedy}; {self.report}")
        if time.perf_counter() - self._drawn_s > refresh_s:
            self._draw(share)
            if self.playback is not None:
                report_progress(str(self.report))
            self._drawn_s = time.perf_counter()


def _play_scene(
    scene: str, given: dict[str, Any], materials: WantedMaterials, space: SpaceWish, show: _Show
) -> tuple[str, ...]:
    with quiet_stderr():
        from sonic_bullet.files import check_sr
        from sonic_bullet.scene import run_scene
        from sonic_bullet.session import Listener

    def begin(listener: Listener) -> None:
        show.playback = listener.play(**show.card)

    notes: list[str] = []

    def receive(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
        made, said = space.received(space.paths or sensors, check_sr(given.get("sr", DEFAULT_SR)))
        notes.extend(said)
        return made

    if space:
        given["receive"] = receive
    with progress_to(fraction=show):
        return (*run_scene(scene, begin, **given, **materials.options), *notes)


def _play_log(
    path: str, given: dict[str, Any], materials: WantedMaterials, space: SpaceWish, show: _Show
) -> tuple[str, ...]:
    import numpy as np

    from sonic_bullet.engine.runtime.replay import LATENCY_STEPS, log_frames
    from sonic_bullet.files import check_sr, read_log
    from sonic_bullet.records import Microphone, channels_of
    from sonic_bullet.records.coerce import as_number
    from sonic_bullet.session.chosen_in_log import with_choice
    from sonic_bullet.session.live import start_playback

    log, said = with_choice(read_log(path), materials.choice(), path)
    log = replace(
        log,
        sr=check_sr(given.get("sr", log.sr)),
        seed=given.get("seed", log.seed),
        sensors=tuple(Microphone(np.array(place)) for place in given.get("microphones", ())) or log.sensors,
    )
    if space:
        log, more = space.applied(log, path)
        said = (*said, *more)
    seconds = as_number(given.get("seconds", log.duration_s), "seconds", "give --seconds above 0", above=0)
    log = log.first(int((log.start_s < seconds - 1e-9).sum()))
    frames = log_frames(log)
    with start_playback(
        show.card.pop("device", None),
        sr=log.sr,
        channels=channels_of(log.sensors),
        lag_steps=LATENCY_STEPS,
        **show.card,
    ) as show.playback:
        for number, frame in enumerate(frames, start=1):
            show.playback.push(frame, time.perf_counter())
            show(number / len(log.steps))
    return said
