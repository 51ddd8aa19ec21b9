"""Command `play`: a scene or a contact log on a sound card while it runs, paced by the card."""

from __future__ import annotations

import math
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from sonic_bullet.apps.cli.output import clean_stdout, places, progress_bar, quiet_stderr, write_json
from sonic_bullet.apps.cli.scenes.receivers import Receivers
from sonic_bullet.apps.cli.scenes.scene_runs import check_scene_file, checked_scene, is_log, prepare_log
from sonic_bullet.machine.progress import fraction_listener, progress_to, report_progress
from sonic_bullet.options.option import keywords
from sonic_bullet.options.play import CardOptions, PlayOptions
from sonic_bullet.options.render import DEFAULT_SR, RenderSceneOptions, SceneOptions
from sonic_bullet.records.errors import AudioError, SceneError

if TYPE_CHECKING:
    from sonic_bullet.records import Sensor
    from sonic_bullet.session.live import Playback, PlaybackReport


def run_play(scene: str, options: PlayOptions) -> None:
    """Run `play`; raises SonicBulletError."""
    path = Path(scene)
    check_scene_file(scene, "play")
    asked, space = checked_scene(options.scene), Receivers.read(options.space)
    if not is_log(scene):
        space.check_live()
    (json_to,) = places(options.json_to)
    device = options.card.device
    card = replace(options.card, device=int(device) if isinstance(device, str) and device.isdecimal() else device)
    with clean_stdout(json_to) as echo:
        with progress_bar(path.name):
            show = _Show(card)
            try:
                notes = (_play_log if is_log(scene) else _play_scene)(scene, asked, space, show)
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

    def __init__(self, card: CardOptions) -> None:
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


def _play_scene(path: str, scene: SceneOptions, space: Receivers, show: _Show) -> tuple[str, ...]:
    with quiet_stderr():
        from sonic_bullet.scene import run_scene
        from sonic_bullet.session import Listener

    def begin(listener: Listener) -> None:
        show.playback = listener.play(**keywords(show.card))

    notes: list[str] = []

    def receive(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
        made, said = space.with_receivers(space.paths or sensors, scene.sr or DEFAULT_SR)
        notes.extend(said)
        return made

    with progress_to(fraction=show):
        asked = keywords(scene) | {"receive": receive if space else None}
        return (*run_scene(path, begin, **asked), *notes)


def _play_log(path: str, scene: SceneOptions, space: Receivers, show: _Show) -> tuple[str, ...]:
    from sonic_bullet.engine.runtime.replay import LATENCY_STEPS, log_frames
    from sonic_bullet.records import channels_of
    from sonic_bullet.session.live import start_playback

    log, said = prepare_log(path, RenderSceneOptions(**keywords(replace(scene, seconds=None))))
    log = replace(log, sr=scene.sr or log.sr)
    if space:
        log, more = space.apply_to(log, path)
        said = (*said, *more)
    if scene.seconds is not None:
        log = log.first(int((log.start_s < scene.seconds - 1e-9).sum()))
    frames = log_frames(log)
    with start_playback(
        **keywords(show.card), sr=log.sr, channels=channels_of(log.sensors), lag_steps=LATENCY_STEPS
    ) as show.playback:
        for number, frame in enumerate(frames, start=1):
            show.playback.push(frame, time.perf_counter())
            show(number / len(log.steps))
    return said
